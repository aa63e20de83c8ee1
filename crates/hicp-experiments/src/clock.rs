//! The processor time of a thread.

use std::time::Duration;

/// Returns the processor time of the calling thread. It excludes other programs and waiting.
#[cfg(unix)]
pub(crate) fn thread_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    let (Ok(seconds), Ok(nanoseconds)) = (time.tv_sec.try_into(), time.tv_nsec.try_into()) else {
        unreachable!("the processor time of a thread is never negative");
    };
    Duration::new(seconds, nanoseconds)
}

/// Returns the time since the first call. Only Unix has a portable clock of a thread.
#[cfg(not(unix))]
pub(crate) fn thread_time() -> Duration {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    START.get_or_init(std::time::Instant::now).elapsed()
}
