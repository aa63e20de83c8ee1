//! A source file that holds many mutants, each behind its switch.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use anyhow::{Result, anyhow};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

use crate::listing::Mutant;

/// What is added to the crate: whether a mutant is on, and which ones were asked for.
pub(crate) const SWITCH: &str = include_str!("switch.txt");

/// A file with its mutants in it.
pub(crate) struct Woven {
    pub(crate) text: String,
    /// Where what a mutant has instead of the original is in the text.
    pub(crate) alternatives: Vec<(Range<usize>, usize)>,
    /// Where places with mutants are in the text, originals and alternatives, with the mutants.
    pub(crate) places: Vec<(Range<usize>, Vec<usize>)>,
    /// Mutants that cannot be put behind a switch.
    pub(crate) left: Vec<usize>,
}

/// Something that stands at a place of the original text.
#[derive(Debug)]
enum Edit {
    /// Text that is inserted; a mutant's, or part of what surrounds one.
    Insert(String, usize),
    /// An expression that mutants have otherwise.
    Choice(Vec<(usize, String)>),
}

/// Puts mutants into a file.
pub(crate) fn weave(text: &str, mutants: &[(usize, &Mutant)]) -> Result<Woven> {
    let file = syn::parse_file(text).map_err(|error| anyhow!("syn: {error}"))?;
    let mut places = Places::default();
    places.visit_file(&file);
    let mut edits: BTreeMap<Place, Edit> = BTreeMap::new();
    let mut left = Vec::new();
    for &(id, mutant) in mutants {
        if !add(&mut edits, text, &places, id, mutant) {
            left.push(id);
        }
    }
    let edits: Vec<(Place, Edit)> = edits.into_iter().collect();
    let mut woven = Woven {
        text: String::with_capacity(2 * text.len()),
        alternatives: Vec::new(),
        places: Vec::new(),
        left,
    };
    woven.render(text, 0..text.len(), &edits);
    Ok(woven)
}

/// The order of edits: where they begin; what is inserted there comes before what is changed there; the larger first.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    begin: usize,
    is_choice: bool,
    /// Of the end, so that the larger come first; of an insertion, its number.
    order: std::cmp::Reverse<usize>,
}

impl Place {
    fn choice(range: &Range<usize>) -> Self {
        Self {
            begin: range.start,
            is_choice: true,
            order: std::cmp::Reverse(range.end),
        }
    }

    fn insertion(at: usize, id: usize) -> Self {
        Self {
            begin: at,
            is_choice: false,
            order: std::cmp::Reverse(id),
        }
    }

    fn end(&self) -> usize {
        if self.is_choice {
            self.order.0
        } else {
            self.begin
        }
    }
}

/// The text that asks whether a mutant is on.
fn on(id: usize) -> String {
    format!("crate::mutation_switch::on({id})")
}

fn add(
    edits: &mut BTreeMap<Place, Edit>,
    text: &str,
    places: &Places,
    id: usize,
    mutant: &Mutant,
) -> bool {
    let Range { start, end } = mutant.range;
    let mut choose = |range: &Range<usize>| {
        let before = &text[range.start..start];
        let after = &text[end..range.end];
        let alternative = format!("{before}{}{after}", mutant.replacement);
        let edit = edits
            .entry(Place::choice(range))
            .or_insert_with(|| Edit::Choice(Vec::new()));
        if let Edit::Choice(alternatives) = edit {
            alternatives.push((id, alternative));
        }
        true
    };
    match mutant.genre.as_str() {
        "BinaryOperator" | "UnaryOperator" => places.operators.get(&start).is_some_and(choose),
        "MatchArmGuard" => choose(&mutant.range.clone()),
        "StructField" => places.fields.get(&start).is_some_and(choose),
        // An `impl Trait` is one type, which a second way out of the function does not have.
        "FnValue" if mutant.returns_impl => false,
        "FnValue" => {
            let early = format!("if {} {{ return {}; }} ", on(id), mutant.replacement);
            edits.insert(Place::insertion(start, id), Edit::Insert(early, id));
            true
        }
        "MatchArm" => places.arms.get(&start).is_some_and(|arm| {
            match arm {
                Arm::Free(at) => {
                    let guard = format!(" if !{}", on(id));
                    edits.insert(Place::insertion(*at, id), Edit::Insert(guard, id));
                }
                Arm::Guarded(guard) => {
                    let before = format!("!{} && (", on(id));
                    edits.insert(Place::insertion(guard.start, id), Edit::Insert(before, id));
                    edits.insert(
                        Place::insertion(guard.end, id),
                        Edit::Insert(")".to_owned(), id),
                    );
                }
            }
            true
        }),
        _ => false,
    }
}

impl Woven {
    /// Writes a range of the original with its edits, which are in order.
    fn render(&mut self, text: &str, range: Range<usize>, edits: &[(Place, Edit)]) {
        let (mut at, mut i) = (range.start, 0);
        while let Some((place, edit)) = edits.get(i) {
            self.text.push_str(&text[at..place.begin]);
            let begin = self.text.len();
            i += 1;
            match edit {
                Edit::Insert(inserted, id) => {
                    self.text.push_str(inserted);
                    self.alternatives.push((begin..self.text.len(), *id));
                }
                Edit::Choice(alternatives) => {
                    let inside = edits[i..]
                        .iter()
                        .take_while(|(p, _)| p.end() <= place.end() && p.begin < place.end())
                        .count();
                    self.text.push('(');
                    for (id, alternative) in alternatives {
                        self.text.push_str(&format!("if {} {{ ", on(*id)));
                        let begin = self.text.len();
                        self.text.push_str(alternative);
                        self.alternatives.push((begin..self.text.len(), *id));
                        self.text.push_str(" } else ");
                    }
                    self.text.push_str("{ ");
                    self.render(text, place.begin..place.end(), &edits[i..i + inside]);
                    self.text.push_str(" })");
                    let ids = alternatives.iter().map(|(id, _)| *id).collect();
                    self.places.push((begin..self.text.len(), ids));
                    i += inside;
                }
            }
            at = place.end();
        }
        self.text.push_str(&text[at..range.end]);
    }
}

/// Where a mutant that deletes a match arm can be put.
#[derive(Debug)]
enum Arm {
    /// The end of its pattern.
    Free(usize),
    /// Its guard.
    Guarded(Range<usize>),
}

/// Expressions by where the thing begins that mutants change.
#[derive(Default)]
struct Places {
    /// By the first byte of the operator.
    operators: HashMap<usize, Range<usize>>,
    /// By the first byte of the field.
    fields: HashMap<usize, Range<usize>>,
    /// By the first byte of the arm.
    arms: HashMap<usize, Arm>,
}

fn range(of: &impl Spanned) -> Range<usize> {
    of.span().byte_range()
}

impl<'ast> Visit<'ast> for Places {
    fn visit_expr_binary(&mut self, binary: &'ast syn::ExprBinary) {
        // `a && let Some(b) = c` is no expression of its own.
        if !holds_let(&binary.left) && !holds_let(&binary.right) {
            self.operators
                .insert(range(&binary.op).start, range(binary));
        }
        visit::visit_expr_binary(self, binary);
    }

    fn visit_expr_unary(&mut self, unary: &'ast syn::ExprUnary) {
        self.operators.insert(range(&unary.op).start, range(unary));
        visit::visit_expr_unary(self, unary);
    }

    fn visit_expr_struct(&mut self, literal: &'ast syn::ExprStruct) {
        for field in &literal.fields {
            self.fields.insert(range(field).start, range(literal));
        }
        visit::visit_expr_struct(self, literal);
    }

    fn visit_arm(&mut self, arm: &'ast syn::Arm) {
        let place = match &arm.guard {
            Some((_, guard)) => Arm::Guarded(range(guard)),
            None => Arm::Free(range(&arm.pat).end),
        };
        self.arms.insert(range(arm).start, place);
        visit::visit_arm(self, arm);
    }
}

/// Whether an operand of `&&` binds names.
fn holds_let(expression: &syn::Expr) -> bool {
    match expression {
        syn::Expr::Let(_) => true,
        syn::Expr::Binary(binary) => holds_let(&binary.left) || holds_let(&binary.right),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mutant(text: &str, genre: &str, what: &str, replacement: &str) -> Mutant {
        let start = text.find(what).unwrap();
        Mutant {
            name: String::new(),
            file: String::new(),
            genre: genre.to_owned(),
            range: start..start + what.len(),
            replacement: replacement.to_owned(),
            returns_impl: false,
            key: crate::listing::Key::default(),
        }
    }

    fn woven(text: &str, mutants: &[Mutant]) -> Woven {
        let numbered: Vec<(usize, &Mutant)> = mutants.iter().enumerate().collect();
        let woven = weave(text, &numbered).unwrap();
        syn::parse_file(&woven.text).unwrap();
        woven
    }

    #[test]
    fn choices_stand_inside_of_each_other() {
        let text = "fn f(a: i32, b: i32, c: i32) -> i32 { a + b * c }";
        let mutants = [
            mutant(text, "BinaryOperator", "+", "-"),
            mutant(text, "BinaryOperator", "+", "*"),
            mutant(text, "BinaryOperator", "*", "/"),
            mutant(text, "FnValue", "a + b * c", "0"),
        ];
        let woven = woven(text, &mutants);
        let on = |id: usize| format!("crate::mutation_switch::on({id})");
        let expected = format!(
            "fn f(a: i32, b: i32, c: i32) -> i32 {{ if {} {{ return 0; }} (if {} {{ a - b * c }} else if {} {{ a * b * c }} else {{ a + (if {} {{ b / c }} else {{ b * c }}) }}) }}",
            on(3),
            on(0),
            on(1),
            on(2)
        );
        assert_eq!(woven.text, expected);
        for (range, id) in &woven.alternatives {
            assert!(woven.text[range.clone()].contains(&mutants[*id].replacement));
        }
        assert_eq!(woven.places.len(), 2);
        assert!(woven.left.is_empty());
    }

    #[test]
    fn arms_guards_and_fields() {
        let text = "fn f(x: u8) -> S { match x { 0 => S { a: 1, ..D }, 1 if x > 0 => D, _ => D } }";
        let mutants = [
            mutant(text, "MatchArm", "0 => S { a: 1, ..D }", ""),
            mutant(text, "StructField", "a: 1,", ""),
            mutant(text, "MatchArm", "1 if x > 0 => D", ""),
            mutant(text, "MatchArmGuard", "x > 0", "true"),
            mutant(text, "BinaryOperator", "> 0", "< 0"),
        ];
        let woven = woven(text, &mutants);
        assert!(
            woven
                .text
                .contains("0 if !crate::mutation_switch::on(0) =>")
        );
        assert!(
            woven
                .text
                .contains("{ S {  ..D } } else { S { a: 1, ..D } }")
        );
        assert!(woven.text.contains("1 if !crate::mutation_switch::on(2) && ((if crate::mutation_switch::on(3) { true } else"));
        assert!(woven.left.is_empty());
    }

    #[test]
    fn what_returns_an_unnamed_type_is_left() {
        let text = "fn f() -> impl Iterator<Item = u8> { g() }";
        let mut mutant = mutant(text, "FnValue", "g()", "std::iter::empty()");
        mutant.returns_impl = true;
        assert_eq!(woven(text, &[mutant]).left, [0]);
    }

    #[test]
    fn what_binds_names_is_left() {
        let text = "fn f(a: bool, b: Option<u8>) { if a && let Some(_) = b {} }";
        let woven = woven(text, &[mutant(text, "BinaryOperator", "&&", "||")]);
        assert_eq!(woven.left, [0]);
        assert_eq!(woven.text, text);
    }
}
