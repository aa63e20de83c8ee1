//! Tests of ROC areas and reliability tables, on cases counted by hand.

use hicp_score::{LabeledScore, reliability, roc_area};

fn labeled(list: &[(f64, bool)]) -> Vec<LabeledScore> {
    let of = |(score, correct): &(f64, bool)| LabeledScore {
        score: *score,
        correct: *correct,
    };
    list.iter().map(of).collect()
}

fn area(list: &[(f64, bool)]) -> Option<f64> {
    roc_area(&labeled(list))
}

#[test]
fn areas_counted_by_hand() {
    // In order, in reverse, all tied.
    assert_eq!(area(&[(0.9, true), (0.1, false)]), Some(1.0));
    assert_eq!(area(&[(0.1, true), (0.9, false)]), Some(0.0));
    assert_eq!(area(&[(0.4, true), (0.4, false), (0.4, false)]), Some(0.5));
    // Correct 3, 1; wrong 2, 0: of the pairs (3,2) (3,0) (1,2) (1,0), three are in order.
    let four = [(3.0, true), (2.0, false), (1.0, true), (0.0, false)];
    assert_eq!(area(&four), Some(0.75));
    // Correct 2, 1, 1; wrong 1, 0: (2,1) 1, (2,0) 1, twice (1,1) ½ and (1,0) 1: 5 of 6.
    let ties = [
        (1.0, true),
        (0.0, false),
        (1.0, false),
        (2.0, true),
        (1.0, true),
    ];
    assert_eq!(area(&ties), Some(5.0 / 6.0));
    // 0 and −0 are the same score.
    assert_eq!(area(&[(0.0, true), (-0.0, false)]), Some(0.5));
    assert_eq!(area(&[(0.5, true), (0.7, true)]), None);
    assert_eq!(area(&[(0.5, false)]), None);
    assert_eq!(area(&[]), None);
}

#[test]
fn the_area_is_the_share_of_pairs_in_order() {
    let list: Vec<(f64, bool)> = (0..60_u32)
        .map(|i| (f64::from(i * 37 % 11) / 10.0, i * 53 % 7 < 3))
        .collect();
    let (mut won, mut pairs) = (0.0, 0.0);
    for (right, _) in list.iter().filter(|(_, correct)| *correct) {
        for (wrong, _) in list.iter().filter(|(_, correct)| !*correct) {
            pairs += 1.0;
            won += match right.total_cmp(wrong) {
                std::cmp::Ordering::Greater => 1.0,
                std::cmp::Ordering::Equal => 0.5,
                std::cmp::Ordering::Less => 0.0,
            };
        }
    }
    let found = area(&list).unwrap_or(f64::NAN);
    assert!((found - won / pairs).abs() < 1e-12, "{found}");
    // A map that keeps the order keeps the area.
    let squared: Vec<_> = list.iter().map(|(s, c)| (s * s - 3.0, *c)).collect();
    assert_eq!(area(&squared), area(&list));
}

#[test]
fn bins_contain_their_lower_bounds() {
    let list = [
        (0.0, false),
        (0.1, false),
        (0.25, true),
        (0.5, false),
        (0.75, true),
        (0.9, true),
        (1.0, true),
        (-3.0, false),
        (7.0, true),
    ];
    let table = reliability(&labeled(&list), 4);
    let bounds: Vec<_> = table.iter().map(|b| (b.lower, b.upper)).collect();
    assert_eq!(bounds, [(0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0)]);
    let counts: Vec<_> = table.iter().map(|b| (b.count, b.correct)).collect();
    assert_eq!(counts, [(3, 0), (1, 1), (1, 0), (4, 4)]);
    assert_eq!(table[1].mean_score(), Some(0.25));
    assert_eq!(table[3].share_correct(), Some(1.0));
    // Of 0, 0.1 and −3, and of 0.75, 0.9, 1 and 7.
    for (index, mean) in [(0, -2.9 / 3.0), (3, 9.65 / 4.0)] {
        assert!((table[index].mean_score().unwrap_or(0.0) - mean).abs() < 1e-15);
    }
    let empty = reliability(&[], 2);
    assert_eq!(
        (empty[0].share_correct(), empty[1].mean_score()),
        (None, None)
    );
    assert!(reliability(&labeled(&list), 0).is_empty());
}
