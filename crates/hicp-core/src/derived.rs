//! Things computed once from an observation or a model and shared by everyone who holds it.

use std::any::{Any, TypeId};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

type Slot = Arc<OnceLock<Arc<dyn Any + Send + Sync>>>;

/// A cache of values derived from one immutable owner, such as a search tree over an observation's points.
///
/// The owner does not know the types: a crate keeps its own index type here without showing it. Values are keyed by
/// type and by a number that stands for the parameters they were built with; each is built once, on first use, and read
/// by all threads. A clone of the owner starts with an empty cache of its own.
#[derive(Default)]
pub struct Derived {
    slots: Mutex<Vec<(TypeId, u64, Slot)>>,
}

impl Derived {
    /// Returns the value of type `T` under `key`, building it first if nobody has.
    ///
    /// Threads that ask for the same value wait for the one that builds it; others do not wait. `build` may ask for other values but not
    /// for its own, for which it would wait for ever. Values live as long as their owner. Cost when present: one
    /// uncontended lock and a short scan, no allocation.
    pub fn get_or_build<T, F>(&self, key: u64, build: F) -> Arc<T>
    where
        T: Any + Send + Sync,
        F: Fn() -> T,
    {
        let slot = {
            // The list is only ever appended to, so a panic elsewhere cannot leave it half done.
            let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
            let wanted = TypeId::of::<T>();
            match slots.iter().find(|(id, k, _)| *id == wanted && *k == key) {
                Some((_, _, slot)) => Arc::clone(slot),
                None => {
                    let slot = Slot::default();
                    slots.push((wanted, key, Arc::clone(&slot)));
                    slot
                }
            }
        };
        let value = Arc::clone(slot.get_or_init(|| Arc::new(build())));
        let Ok(value) = value.downcast::<T>() else {
            unreachable!("the slot was found by the id of its type");
        };
        value
    }
}

impl Clone for Derived {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl std::fmt::Debug for Derived {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
        f.debug_struct("Derived")
            .field("values", &slots.len())
            .finish()
    }
}
