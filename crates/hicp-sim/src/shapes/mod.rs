//! The shapes of the household objects, metres, z up.

mod boxes;
mod tools;
mod vessels;

use crate::household::Household;
use crate::solid::Solid;

/// Makes an object's solid in its nominal proportions.
pub(crate) fn solid(object: Household) -> Solid {
    match object {
        Household::Mug => vessels::mug(),
        Household::Bottle => vessels::bottle(),
        Household::Bowl => vessels::bowl(),
        Household::Carton => boxes::carton(),
        Household::Bracket => tools::bracket(),
        Household::Hammer => tools::hammer(),
        Household::Plate => vessels::plate(),
        Household::Iron => tools::iron(),
        Household::Car => boxes::car(),
        Household::Pan => vessels::pan(),
        Household::Can => vessels::can(),
        Household::Laptop => boxes::laptop(),
        Household::Teapot => vessels::teapot(),
        Household::Knife => tools::knife(),
        Household::Book => boxes::book(),
        Household::Pot => vessels::pot(),
        Household::Tape => tools::tape(),
        Household::Headphones => boxes::headphones(),
        Household::Camera => boxes::camera(),
        Household::Ladle => vessels::ladle(),
    }
}
