//! Ctrl-C and SIGTERM: the program ends within a second, with what is done saved.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::bail;
use hicp_io::NewFolder;
#[cfg(unix)]
use signal_hook::consts::SIGXFSZ;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::terminal::{complain, warn};

/// Exit code of a program that was interrupted, as shells have it for Ctrl-C.
pub(crate) const EXIT_CODE: u8 = 130;

/// How long a command that saves its work has to come to an end of its own.
const GRACE: Duration = Duration::from_millis(700);

/// How often the flag is looked at.
const PERIOD: Duration = Duration::from_millis(20);

/// For how long the program tries to remove what is unfinished, and how long it waits in between.
const REMOVAL: Duration = Duration::from_millis(700);
const BETWEEN_REMOVALS: Duration = Duration::from_millis(2);

static ASKED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
static SAVING: AtomicBool = AtomicBool::new(false);
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Listens from now on.
///
/// The first signal asks commands that save their work to stop, and ends the program when they take too long; what they have
/// put on the disk until then is whole. Other commands end at once: they write nothing before they are done. A second signal
/// ends the program where it stands.
pub(crate) fn listen() {
    for signal in [SIGINT, SIGTERM] {
        let asked = &*ASKED;
        let heard =
            flag::register_conditional_shutdown(signal, i32::from(EXIT_CODE), Arc::clone(asked))
                .and_then(|_| flag::register(signal, Arc::clone(asked)));
        if let Err(error) = heard {
            warn(format_args!(
                "signal {signal} ends the program unsaved: {error}"
            ));
        }
    }
    // A file beyond the limit of this user is then an error of the write, which is told, and not the end of the program with a
    // temporary file left behind.
    #[cfg(unix)]
    if let Err(error) = flag::register(SIGXFSZ, Arc::default()) {
        warn(format_args!("signal {SIGXFSZ} ends the program: {error}"));
    }
    std::thread::spawn(|| {
        while !asked() {
            std::thread::sleep(PERIOD);
        }
        if SAVING.load(Ordering::Relaxed) {
            std::thread::sleep(GRACE);
        }
        // A second signal need not wait for this.
        let unfinished = UNFINISHED
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if let Some(unfinished) = unfinished {
            remove(&unfinished);
        }
        complain("interrupted");
        std::process::exit(i32::from(EXIT_CODE));
    });
}

/// Says that what the command does from now on looks at [`asked`] and can be resumed.
pub(crate) fn can_resume() {
    SAVING.store(true, Ordering::Relaxed);
}

/// Removes a folder that others may be writing into: they fail as soon as what they write into is gone.
fn remove(folder: &Path) {
    let start = Instant::now();
    while std::fs::remove_dir_all(folder).is_err() && folder.exists() && start.elapsed() < REMOVAL {
        std::thread::sleep(BETWEEN_REMOVALS);
    }
}

/// Begins a folder that is removed when somebody asks the program to stop. After somebody has, there is none.
pub(crate) fn begin_folder(path: &Path) -> anyhow::Result<NewFolder> {
    let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    if asked() {
        bail!("interrupted");
    }
    let folder = NewFolder::begin(path)?;
    *unfinished = Some(folder.path().to_owned());
    Ok(folder)
}

/// Puts a folder in its place, unless it is being removed: then not even a part of it gets there.
pub(crate) fn finish_folder(folder: NewFolder) -> anyhow::Result<()> {
    let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    if unfinished.take().is_none() {
        bail!("interrupted");
    }
    Ok(folder.finish()?)
}

/// Waits for the end of a program that was asked to stop and saves nothing: what failed since then may well have failed because
/// what is unfinished is being removed, and says nothing to anybody.
pub(crate) fn end_unless_saving() {
    while asked() && !SAVING.load(Ordering::Relaxed) {
        std::thread::park();
    }
}

/// Whether somebody asked the program to stop.
pub(crate) fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}
