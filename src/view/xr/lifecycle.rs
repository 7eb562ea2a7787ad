//! The states of an OpenXR session (OpenXR 1.0, section 9.3), and what a program has to do when they change.

/// State of a session, as the runtime tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SessionState {
    /// The session has just been made; no event has come.
    Unknown,
    /// Not running: the headset may be asleep.
    Idle,
    /// The runtime waits for the session to begin.
    Ready,
    /// Running in step with the runtime, not seen.
    Synchronized,
    /// Seen, without input.
    Visible,
    /// Seen, with input.
    Focused,
    /// The runtime wants the session to end.
    Stopping,
    /// The session is about to be lost, as when the headset is unplugged.
    LossPending,
    /// The session is over: somebody has asked for that.
    Exiting,
}

impl SessionState {
    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Idle => "idle",
            Self::Ready => "ready",
            Self::Synchronized => "synchronized",
            Self::Visible => "visible",
            Self::Focused => "focused",
            Self::Stopping => "stopping",
            Self::LossPending => "loss pending",
            Self::Exiting => "exiting",
        }
    }

    /// Whether a runtime may go from here to `next` (the diagram of section 9.3; sessions may be lost at any time).
    pub fn leads_to(self, next: Self) -> bool {
        use SessionState::*;
        matches!(
            (self, next),
            (Unknown, Idle)
                | (Idle, Ready | Exiting)
                | (Ready, Synchronized)
                | (Synchronized, Visible | Stopping)
                | (Visible, Synchronized | Focused)
                | (Focused, Visible)
                | (Stopping, Idle)
                | (_, LossPending)
        )
    }
}

/// What has to be done now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Nothing but going on.
    GoOn,
    /// Begin the session: xrBeginSession.
    Begin,
    /// End the session: xrEndSession. It may be ready again later.
    End,
    /// Destroy the session.
    Quit(Ending),
}

/// How a session came to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It was exited, by the program or by the runtime.
    Exited,
    /// It was lost.
    Lost,
}

/// The state of a session and what follows from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lifecycle {
    state: SessionState,
    running: bool,
    odd: u32,
}

impl Default for Lifecycle {
    fn default() -> Self {
        Self { state: SessionState::Unknown, running: false, odd: 0 }
    }
}

impl Lifecycle {
    /// Takes a change of state in.
    pub fn enter(&mut self, next: SessionState) -> Step {
        if !self.state.leads_to(next) {
            self.odd += 1;
        }
        self.state = next;
        match next {
            SessionState::Ready if !self.running => {
                self.running = true;
                Step::Begin
            }
            SessionState::Stopping if self.running => {
                self.running = false;
                Step::End
            }
            SessionState::LossPending => {
                self.running = false;
                Step::Quit(Ending::Lost)
            }
            SessionState::Exiting => {
                self.running = false;
                Step::Quit(Ending::Exited)
            }
            _ => Step::GoOn,
        }
    }

    /// The state.
    pub fn state(&self) -> SessionState {
        self.state
    }

    /// Whether frames have to be waited for, begun and ended: between the beginning and the end of the session, seen or not.
    pub fn is_running(&self) -> bool {
        self.running
    }

    /// Whether there is input.
    pub fn is_focused(&self) -> bool {
        self.state == SessionState::Focused
    }

    /// Changes of state that a runtime should not make. They are followed all the same.
    pub fn odd_changes(&self) -> u32 {
        self.odd
    }
}
