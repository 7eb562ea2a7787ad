//! Runtimes that do not come back. A call that hangs inside of a runtime cannot be broken off, so after a while the whole
//! program ends, with one line that says which call it was.

use std::{
    io::Write,
    sync::{Arc, Mutex, PoisonError},
    thread,
    time::{Duration, Instant},
};

/// How long a call may take. With the reaction of the program it stays below [`PATIENCE`](super::frames::PATIENCE).
const LIMIT: Duration = Duration::from_millis(4500);

/// How often is looked.
const STEP: Duration = Duration::from_millis(100);

/// The exit code for failures.
const FAILED: i32 = 2;

/// Watches the calls of one thread.
#[derive(Debug)]
pub struct Watchdog {
    /// The call under way and since when; none while the program itself is at work.
    call: Arc<Mutex<Option<(&'static str, Instant)>>>,
}

impl Watchdog {
    /// Starts to watch; `hung` is called with the name of a call that takes too long, and must end the program.
    pub fn new(hung: impl Fn(&'static str) + Send + 'static) -> Self {
        Self::with_limit(LIMIT, hung)
    }

    /// The same with another limit.
    pub fn with_limit(limit: Duration, hung: impl Fn(&'static str) + Send + 'static) -> Self {
        let call = Arc::new(Mutex::new(None::<(&'static str, Instant)>));
        let watched = Arc::downgrade(&call);
        let watch = move || {
            loop {
                thread::sleep(STEP.min(limit));
                // The end of the watchdog is the end of its thread.
                let Some(call) = watched.upgrade() else { return };
                let under_way = *call.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some((name, _)) = under_way.filter(|(_, since)| since.elapsed() > limit) {
                    hung(name);
                    return;
                }
            }
        };
        // Without a thread nobody watches, and all else works.
        let _ = thread::Builder::new().name(String::from("watchdog")).spawn(watch);
        Self { call }
    }

    /// Makes a call under watch.
    pub fn watch<T>(&self, name: &'static str, call: impl FnOnce() -> T) -> T {
        *self.call.lock().unwrap_or_else(PoisonError::into_inner) = Some((name, Instant::now()));
        let result = call();
        *self.call.lock().unwrap_or_else(PoisonError::into_inner) = None;
        result
    }
}

/// Ends the program with one line.
pub fn end_program(call: &'static str) {
    let seconds = super::frames::PATIENCE.as_secs();
    let _ = writeln!(std::io::stderr(), "holonomy: {call}: the OpenXR runtime has not answered for nearly {seconds} s");
    // Leaving runs the libraries' own ends, which may wait for the thread that hangs.
    let _ = thread::Builder::new().spawn(|| {
        thread::sleep(Duration::from_millis(300));
        std::process::abort();
    });
    std::process::exit(FAILED);
}
