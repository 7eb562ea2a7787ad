//! How far long work is, on a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::{
    io::IsTerminal,
    sync::OnceLock,
    time::{Duration, Instant},
};

/// A bar on stderr, only on a terminal and only for work that takes longer than a second.
pub(super) struct Progress {
    started: Instant,
    shown: bool,
    bar: OnceLock<ProgressBar>,
}

impl Progress {
    const STEPS: u64 = 1000;

    /// A bar that is not shown yet.
    pub(super) fn new() -> Self {
        Self { started: Instant::now(), shown: std::io::stderr().is_terminal(), bar: OnceLock::new() }
    }

    /// Shows how far the work is.
    pub(super) fn set(&self, share: f64) {
        self.say("", share);
    }

    /// The same with what is at work.
    pub(super) fn say(&self, what: &str, share: f64) {
        if !self.shown || (self.started.elapsed() < Duration::from_secs(1) && self.bar.get().is_none()) {
            return;
        }
        let bar = self.bar.get_or_init(|| {
            let bar = ProgressBar::with_draw_target(Some(Self::STEPS), ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent:>3} %, {eta} left {msg}") {
                bar.set_style(style);
            }
            bar
        });
        bar.set_message(what.to_owned());
        bar.set_position((share * Self::STEPS as f64) as u64);
    }

    /// Takes the bar away.
    pub(super) fn finish(&self) {
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
    }
}
