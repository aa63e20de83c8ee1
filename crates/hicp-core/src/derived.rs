//! Values computed once from an observation or a model and shared by all who hold it.

use std::any::{Any, TypeId};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

type Slot = Arc<OnceLock<Arc<dyn Any + Send + Sync>>>;

/// A cache of values derived from one immutable owner, such as a search tree over its points.
///
/// The owner does not depend on the types of the values, so a crate can cache a private index type
/// here. Values are keyed by type and by a number that stands for the parameters they were built
/// with. Each is built once, on first use, and read by all threads. A clone of the owner starts
/// with an empty cache.
#[derive(Default)]
pub struct Derived {
    slots: Mutex<Vec<(TypeId, u64, Slot)>>,
}

impl Derived {
    /// Returns the value of type `T` under `key`, building it on first use.
    ///
    /// `T` must be a type of the calling crate, such as a newtype. Otherwise two crates can share a
    /// key, and one of them receives the value of the other.
    ///
    /// Threads that request a value under construction wait for it; other threads do not wait.
    /// `build` may request other values. If it requests its own, it waits forever. Values live as
    /// long as their owner.
    ///
    /// Cost if present: one uncontended lock and a short scan, without allocation.
    pub fn get_or_build<T, F>(&self, key: u64, build: F) -> Arc<T>
    where
        T: Any + Send + Sync,
        F: Fn() -> T,
    {
        let slot = {
            // The list only grows, so a panic elsewhere cannot leave it half updated.
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
