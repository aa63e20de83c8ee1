//! Ctrl-C and SIGTERM: the program ends within a second, with what is done saved.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex};
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::terminal::{complain, warn};

/// Exit code of a program that was interrupted, as shells have it for Ctrl-C.
pub(crate) const EXIT_CODE: u8 = 130;

/// How long a command that saves its work has to come to an end of its own.
const GRACE: Duration = Duration::from_millis(700);

/// How often the flag is looked at.
const PERIOD: Duration = Duration::from_millis(20);

/// How often the program tries to remove what is unfinished.
const REMOVALS: usize = 20;

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
    std::thread::spawn(|| {
        while !asked() {
            std::thread::sleep(PERIOD);
        }
        if SAVING.load(Ordering::Relaxed) {
            std::thread::sleep(GRACE);
        }
        // A second signal need not wait for this.
        if let Some(unfinished) = UNFINISHED.lock().ok().and_then(|mut path| path.take()) {
            // Others may be writing into it meanwhile.
            let mut tries = 0..REMOVALS;
            while tries.next().is_some() && std::fs::remove_dir_all(&unfinished).is_err() {}
        }
        complain("interrupted");
        std::process::exit(i32::from(EXIT_CODE));
    });
}

/// Says that what the command does from now on looks at [`asked`] and can be resumed.
pub(crate) fn can_resume() {
    SAVING.store(true, Ordering::Relaxed);
}

/// Says that a folder in the making goes when somebody asks the program to stop.
pub(crate) fn remove_when_asked(folder: &Path) {
    if let Ok(mut unfinished) = UNFINISHED.lock() {
        *unfinished = Some(folder.to_owned());
    }
}

/// Whether somebody asked the program to stop.
pub(crate) fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}
