//! Handles Ctrl-C and SIGTERM: the program ends within a second and keeps the results so far.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use anyhow::bail;
use hicp_io::NewFolder;
#[cfg(unix)]
use signal_hook::consts::SIGXFSZ;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::terminal::{complain, warn};

/// Exit code of an interrupted program, as in shells.
pub(crate) const EXIT_CODE: u8 = 130;

/// Time for a command that saves its work to end on its own.
const GRACE: Duration = Duration::from_millis(700);

/// Time between two checks of the flag.
const PERIOD: Duration = Duration::from_millis(20);

/// Time for removing an unfinished folder.
const REMOVAL: Duration = Duration::from_millis(700);
/// Time between two attempts to remove it.
const BETWEEN_REMOVALS: Duration = Duration::from_millis(2);

static ASKED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
static RESUMED_BY: OnceLock<&str> = OnceLock::new();
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Starts to handle signals.
///
/// The first signal stops commands that save their work, and ends the program if they take too
/// long. Other commands end at once, because they write nothing before they are done. A second
/// signal ends the program immediately.
pub(crate) fn listen() {
    for signal in [SIGINT, SIGTERM] {
        let asked = &*ASKED;
        let heard =
            flag::register_conditional_shutdown(signal, i32::from(EXIT_CODE), Arc::clone(asked))
                .and_then(|_| flag::register(signal, Arc::clone(asked)));
        if let Err(error) = heard {
            warn(format_args!(
                "signal {signal} will end the program without saving its work: {error}"
            ));
        }
    }
    // A file beyond the user's limit is then a write error. By default, the signal would end the
    // program and leave a temporary file behind.
    #[cfg(unix)]
    if let Err(error) = flag::register(SIGXFSZ, Arc::default()) {
        warn(format_args!(
            "signal {SIGXFSZ} will end the program: {error}"
        ));
    }
    std::thread::spawn(|| {
        while !asked() {
            std::thread::sleep(PERIOD);
        }
        if RESUMED_BY.get().is_some() {
            std::thread::sleep(GRACE);
        }
        // Release the lock before removing, so that a second signal does not wait for it.
        let unfinished = UNFINISHED
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if let Some(unfinished) = unfinished {
            remove(&unfinished);
        }
        match RESUMED_BY.get() {
            Some(by) => complain(format_args!("interrupted: continue with {by}")),
            None => complain("interrupted"),
        }
        std::process::exit(i32::from(EXIT_CODE));
    });
}

/// Declares that the command checks [`asked`] from now on, and that `by` resumes its work.
pub(crate) fn can_resume(by: &'static str) {
    // Later calls have no effect: `bop compare` runs several pipelines.
    let _ = RESUMED_BY.set(by);
}

/// Removes a folder while other threads may write into it.
///
/// They fail as soon as the folder is missing.
fn remove(folder: &Path) {
    let start = Instant::now();
    while std::fs::remove_dir_all(folder).is_err() && folder.exists() && start.elapsed() < REMOVAL {
        std::thread::sleep(BETWEEN_REMOVALS);
    }
}

/// Creates a folder that is removed if the program is interrupted. Fails after an interrupt.
pub(crate) fn begin_folder(path: &Path) -> anyhow::Result<NewFolder> {
    let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    if asked() {
        bail!("interrupted");
    }
    let folder = NewFolder::begin(path)?;
    *unfinished = Some(folder.path().to_owned());
    Ok(folder)
}

/// Moves a folder to its place. Fails if an interrupt is removing it.
pub(crate) fn finish_folder(folder: NewFolder) -> anyhow::Result<()> {
    let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    if unfinished.take().is_none() {
        bail!("interrupted");
    }
    Ok(folder.finish()?)
}

/// Waits for the end of an interrupted program that saves nothing.
///
/// Its errors are not reported, because they may come from the removal of an unfinished folder.
pub(crate) fn end_unless_saving() {
    while asked() && RESUMED_BY.get().is_none() {
        std::thread::park();
    }
}

/// Returns whether the program was interrupted.
pub(crate) fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}
