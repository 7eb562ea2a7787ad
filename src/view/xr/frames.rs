//! The loop of a session: events, frames, and all ways to come to an end. It knows runtimes only as a [`Runtime`], so that
//! tests can be one.
//!
//! A frame is: wait for the runtime's pace, begin, take images, locate eyes and hands for the time at which the frame will be
//! seen, draw, give the images back, end. While a session runs but is not seen, frames are begun and ended without pictures,
//! as the runtime wants it.

use super::{
    error::XrError,
    input::Buttons,
    lifecycle::{Ending, Lifecycle, SessionState, Step},
    timing::FrameRecord,
};
use crate::{render::device::eyes::Surfaces, space::body::RoomPose};
use std::time::Duration;

/// Nothing may take longer: neither a call of the runtime nor its reaction to a request.
pub const PATIENCE: Duration = Duration::from_secs(5);

/// What a runtime has to tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The session has another state.
    State(SessionState),
    /// The runtime is about to go.
    InstanceLoss,
    /// The eyes' visible region is another one.
    Mask,
    /// Anything else.
    Other,
}

/// The runtime's plan for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameTime {
    /// When the frame will be seen, in nanoseconds on the runtime's clock.
    pub display: i64,
    /// Time between two frames of the display, in nanoseconds.
    pub period: i64,
    /// Whether anything will be seen.
    pub should_render: bool,
}

/// An eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyePose {
    /// Where it is in the room.
    pub pose: RoomPose,
    /// Angles from the view axis to the left, right, lower and upper border in radians; left and down are negative in a
    /// symmetric frustum.
    pub angles: [f64; 4],
}

impl EyePose {
    /// Tangents of the angles.
    pub fn tangents(&self) -> [f64; 4] {
        self.angles.map(f64::tan)
    }

    /// Whether a picture can be taken through it: finite, not empty, less than half a turn.
    pub fn is_sound(&self) -> bool {
        let [left, right, down, up] = self.angles;
        let within = self.angles.iter().all(|angle| angle.abs() < 1.55);
        self.pose.is_sound() && within && left < right && down < up
    }
}

/// A hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandPose {
    /// Where it holds: the frame that things in the hand have.
    pub grip: Option<RoomPose>,
    /// Where it points: along the third axis backwards.
    pub aim: Option<RoomPose>,
}

/// What is known of the player when a frame is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// The left and the right eye.
    pub eyes: [EyePose; 2],
    /// The head.
    pub head: RoomPose,
    /// The left and the right hand.
    pub hands: [HandPose; 2],
    /// What is pressed.
    pub buttons: Buttons,
}

/// A runtime with a session. Each call may fail with [`XrError::SessionLost`] or [`XrError::RuntimeGone`].
///
/// # Errors
/// Those of all functions are [`XrError`]s of the runtime.
#[allow(clippy::missing_errors_doc)]
pub trait Runtime {
    /// The next event, if there is one.
    fn poll(&mut self) -> Result<Option<Event>, XrError>;
    /// Begins the session.
    fn begin_session(&mut self) -> Result<(), XrError>;
    /// Ends the session.
    fn end_session(&mut self) -> Result<(), XrError>;
    /// Asks the runtime to bring the session to its end.
    fn request_exit(&mut self) -> Result<(), XrError>;
    /// Waits until the next frame should be begun.
    fn wait_frame(&mut self) -> Result<FrameTime, XrError>;
    /// Begins a frame.
    fn begin_frame(&mut self) -> Result<(), XrError>;
    /// Takes the images of the next frame and waits until they may be written.
    fn acquire(&mut self) -> Result<(), XrError>;
    /// The images that have been taken; none in tests without a device.
    fn surfaces(&self) -> Option<Surfaces<'_>>;
    /// Gives the images back.
    fn release(&mut self) -> Result<(), XrError>;
    /// Where the player's parts are at the time of the frame, and what is pressed if the session has the input. None: the
    /// runtime does not know where the eyes are.
    fn look(&mut self, time: FrameTime, focused: bool) -> Result<Option<Look>, XrError>;
    /// Ends the frame, with what has been drawn through these eyes in `size` pixels, or with nothing.
    fn end_frame(&mut self, time: FrameTime, drawn: Option<(&Look, [u32; 2])>) -> Result<(), XrError>;
    /// Triangles that the headset hides from each eye: corners as tangents to the right and up.
    fn hidden(&mut self) -> [Vec<[[f64; 2]; 3]>; 2];
    /// Time since an arbitrary moment.
    fn now(&self) -> Duration;
    /// Lets time pass.
    fn pause(&mut self, time: Duration);
}

/// Draws frames.
pub trait Painter {
    /// Draws what the player sees.
    ///
    /// # Errors
    /// Device faults, and those of the body's motion.
    fn paint(&mut self, look: &Look, time: FrameTime, surfaces: Option<Surfaces<'_>>) -> Result<Painted, XrError>;

    /// Takes in what the headset hides from each eye: see [`Runtime::hidden`].
    fn hide(&mut self, _hidden: [Vec<[[f64; 2]; 3]>; 2]) {}
}

/// What was drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Painted {
    /// Width and height of an eye in pixels.
    pub size: [u32; 2],
    /// Largest number of face passages.
    pub bounces: u32,
    /// Time of tracing.
    pub trace: Duration,
    /// Time of making and copying images.
    pub finish: Duration,
    /// Time of placing the body and what moves.
    pub place: Duration,
}

/// When a loop ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Ends after so many frames that were drawn; never by itself if none.
    pub frames: Option<u32>,
    /// Ends if nothing could be drawn for so long.
    pub asleep: Duration,
}

/// What a loop has done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Frames that were drawn, in order.
    pub frames: Vec<FrameRecord>,
    /// Frames without a picture.
    pub empty_frames: u32,
    /// States that the session went through.
    pub states: Vec<SessionState>,
    /// Changes of state that a runtime should not make.
    pub odd_changes: u32,
}

/// A session while its loop runs.
struct Session<'a> {
    runtime: &'a mut dyn Runtime,
    painter: &'a mut dyn Painter,
    limits: Limits,
    lifecycle: Lifecycle,
    /// Since when nothing was drawn.
    idle_since: Duration,
    /// Since when the session should end.
    leaving_since: Option<Duration>,
    last_display: Option<i64>,
    report: Report,
}

/// Runs a session until it ends.
///
/// # Errors
/// All ends but the one that was asked for. The report tells how far it came.
pub fn run(runtime: &mut dyn Runtime, painter: &mut dyn Painter, limits: Limits) -> (Report, Result<(), XrError>) {
    let idle_since = runtime.now();
    let mut session = Session {
        runtime,
        painter,
        limits,
        lifecycle: Lifecycle::default(),
        idle_since,
        leaving_since: None,
        last_display: None,
        report: Report::default(),
    };
    session.painter.hide(session.runtime.hidden());
    let ended = session.run();
    session.report.odd_changes = session.lifecycle.odd_changes();
    let drawn = session.drawn();
    (session.report, ended.map_err(|error| error.after(drawn)))
}

impl Session<'_> {
    fn drawn(&self) -> u32 {
        self.report.frames.len() as u32
    }

    fn run(&mut self) -> Result<(), XrError> {
        loop {
            if let Some(ending) = self.events()? {
                return self.ended(ending);
            }
            self.check_patience()?;
            if !self.lifecycle.is_running() {
                self.runtime.pause(Duration::from_millis(10));
                continue;
            }
            if self.limits.frames.is_some_and(|wanted| self.drawn() >= wanted) && self.leaving_since.is_none() {
                self.runtime.request_exit()?;
                self.leaving_since = Some(self.runtime.now());
            }
            self.frame()?;
        }
    }

    /// Takes in what the runtime has to tell; how the session ended, if it has.
    fn events(&mut self) -> Result<Option<Ending>, XrError> {
        while let Some(event) = self.runtime.poll()? {
            match event {
                Event::State(state) => {
                    self.report.states.push(state);
                    match self.lifecycle.enter(state) {
                        Step::GoOn => {}
                        Step::Begin => self.runtime.begin_session()?,
                        Step::End => self.runtime.end_session()?,
                        Step::Quit(ending) => return Ok(Some(ending)),
                    }
                }
                Event::InstanceLoss => return Err(XrError::RuntimeGone { frames: 0, call: "loss pending" }),
                Event::Mask => self.painter.hide(self.runtime.hidden()),
                Event::Other => {}
            }
        }
        Ok(None)
    }

    fn ended(&self, ending: Ending) -> Result<(), XrError> {
        match (ending, self.limits.frames) {
            (Ending::Lost, _) => Err(XrError::SessionLost { frames: 0 }),
            (Ending::Exited, Some(wanted)) if self.drawn() < wanted => {
                Err(XrError::EndedEarly { drawn: self.drawn(), wanted })
            }
            (Ending::Exited, _) => Ok(()),
        }
    }

    /// Nobody waits for ever.
    fn check_patience(&self) -> Result<(), XrError> {
        let (now, state) = (self.runtime.now(), self.lifecycle.state());
        if let Some(since) = self.leaving_since {
            let waited = now.saturating_sub(since);
            return if waited < PATIENCE { Ok(()) } else { Err(XrError::NoExit { state, seconds: waited.as_secs() }) };
        }
        let waited = now.saturating_sub(self.idle_since);
        if waited < self.limits.asleep { Ok(()) } else { Err(XrError::Asleep { state, seconds: waited.as_secs() }) }
    }

    fn frame(&mut self) -> Result<(), XrError> {
        let time = self.runtime.wait_frame()?;
        let begun = self.runtime.now();
        self.runtime.begin_frame()?;
        if !time.should_render || self.leaving_since.is_some() {
            self.report.empty_frames += 1;
            return self.runtime.end_frame(time, None);
        }
        self.runtime.acquire()?;
        let looked = self.runtime.now();
        let look = match self.runtime.look(time, self.lifecycle.is_focused()) {
            Ok(look) => look,
            Err(error) => {
                // The image goes back whatever has happened, and the first error is the one to tell.
                let _ = self.runtime.release();
                return Err(error);
            }
        };
        let look = look.filter(|look| look.head.is_sound() && look.eyes.iter().all(EyePose::is_sound));
        let Some(look) = look else {
            self.runtime.release()?;
            self.report.empty_frames += 1;
            return self.runtime.end_frame(time, None);
        };
        let painted = self.painter.paint(&look, time, self.runtime.surfaces());
        let released = self.runtime.release();
        let painted = painted?;
        released?;
        self.runtime.end_frame(time, Some((&look, painted.size)))?;
        let ended = self.runtime.now();
        let periods = |last: i64| (time.display - last) as f64 / time.period.max(1) as f64;
        let missed = self.last_display.map_or(0, |last| (periods(last).round() as i64 - 1).clamp(0, 1_000_000) as u32);
        self.last_display = Some(time.display);
        self.idle_since = ended;
        self.report.frames.push(FrameRecord {
            whole: ended.saturating_sub(begun),
            pose_to_submit: ended.saturating_sub(looked),
            period: Duration::from_nanos(time.period.max(0) as u64),
            missed,
            hands: look.hands.map(|hand| hand.grip.is_some()),
            painted,
        });
        Ok(())
    }
}
