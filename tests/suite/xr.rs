//! Sessions with a headset, played by a runtime that is a few lines of code: every state, every way to come to an end. And
//! what surrounds a session: formats, rays, the hold on the frame rate, the watchdog, bindings.

use glam::{DQuat, DVec3};
use holonomy::{
    render::device::{
        eyes::{Encoding, Surfaces},
        rays::{Rays, Sight},
    },
    shader_io::{LIST_BITS, RATE_TILE},
    space::body::RoomPose,
    view::xr::{
        error::XrError,
        frames::{Event, EyePose, FrameTime, HandPose, Limits, Look, PATIENCE, Painted, Painter, Report, Runtime, run},
        hold::Hold,
        input::{Buttons, PROFILES},
        lifecycle::{Ending, Lifecycle, SessionState, Step},
        swapchain::{color_format, depth_format},
        timing::{percentile, report_json},
        watchdog::Watchdog,
    },
};
use std::{collections::VecDeque, sync::mpsc, time::Duration};

use SessionState::{Exiting, Focused, Idle, LossPending, Ready, Stopping, Synchronized, Unknown, Visible};

const STATES: [SessionState; 9] =
    [Unknown, Idle, Ready, Synchronized, Visible, Focused, Stopping, LossPending, Exiting];

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mishap {
    /// Nothing.
    None,
    /// The headset never wakes up.
    Asleep,
    /// The session runs, but is never seen.
    Unseen,
    /// The eyes are nowhere.
    Blind,
    /// After so many frames the headset is taken off for a while.
    TakenOff(u32),
    /// After so many frames the session is about to be lost.
    LossPending(u32),
    /// After so many frames the runtime says that it goes.
    InstanceLoss(u32),
    /// After so many frames the player leaves by the runtime's own menu.
    Leaves(u32),
    /// The runtime does not react to the wish to end.
    Stubborn,
    /// This call says, at its n-th time, that the session is lost.
    Lost(&'static str, u32),
    /// The same for the runtime.
    Gone(&'static str, u32),
}

/// A runtime that watches whether the program keeps the rules.
struct Fake {
    mishap: Mishap,
    events: VecDeque<Event>,
    clock: Duration,
    calls: Vec<&'static str>,
    frames: u32,
    running: bool,
    exit_asked: bool,
    off: bool,
    waited: bool,
    begun: bool,
    acquired: bool,
}

const PERIOD: Duration = Duration::from_millis(10);

impl Fake {
    fn new(mishap: Mishap) -> Self {
        let mut events = VecDeque::from([Event::State(Idle)]);
        if mishap != Mishap::Asleep {
            events.push_back(Event::State(Ready));
        }
        Self {
            mishap,
            events,
            clock: Duration::from_secs(1),
            calls: Vec::new(),
            frames: 0,
            running: false,
            exit_asked: false,
            off: false,
            waited: false,
            begun: false,
            acquired: false,
        }
    }

    fn call(&mut self, name: &'static str) -> Result<(), XrError> {
        self.calls.push(name);
        let times = self.calls.iter().filter(|call| **call == name).count() as u32;
        match self.mishap {
            Mishap::Lost(call, n) if call == name && times == n => Err(XrError::SessionLost { frames: 0 }),
            Mishap::Gone(call, n) if call == name && times >= n => Err(XrError::RuntimeGone { frames: 0, call: name }),
            _ => Ok(()),
        }
    }

    fn queue(&mut self, states: &[SessionState]) {
        self.events.extend(states.iter().map(|state| Event::State(*state)));
    }
}

impl Runtime for Fake {
    fn poll(&mut self) -> Result<Option<Event>, XrError> {
        self.call("poll")?;
        Ok(self.events.pop_front())
    }

    fn begin_session(&mut self) -> Result<(), XrError> {
        assert!(!self.running, "a session begins once");
        self.running = true;
        self.call("begin_session")?;
        self.queue(&[Synchronized, Visible, Focused]);
        Ok(())
    }

    fn end_session(&mut self) -> Result<(), XrError> {
        assert!(self.running, "only a session that runs can end");
        self.running = false;
        self.call("end_session")?;
        self.queue(&[Idle]);
        if self.off && !self.exit_asked {
            self.off = false;
            self.queue(&[Ready]);
        } else {
            self.queue(&[Exiting]);
        }
        Ok(())
    }

    fn request_exit(&mut self) -> Result<(), XrError> {
        assert!(self.running && !self.exit_asked, "an exit is asked for once");
        self.exit_asked = true;
        self.call("request_exit")?;
        if self.mishap != Mishap::Stubborn {
            self.queue(&[Visible, Synchronized, Stopping]);
        }
        Ok(())
    }

    fn wait_frame(&mut self) -> Result<FrameTime, XrError> {
        assert!(self.running && !self.waited, "frames are waited for one by one, in a session that runs");
        self.clock += PERIOD;
        self.call("wait_frame")?;
        self.waited = true;
        let (display, period) = (self.clock.as_nanos() as i64, PERIOD.as_nanos() as i64);
        Ok(FrameTime { display, period, should_render: self.mishap != Mishap::Unseen })
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        assert!(self.waited && !self.begun, "a frame begins after it was waited for");
        self.begun = true;
        self.call("begin_frame")
    }

    fn acquire(&mut self) -> Result<(), XrError> {
        assert!(self.begun && !self.acquired, "images are taken in a frame");
        self.call("acquire")?;
        self.acquired = true;
        Ok(())
    }

    fn surfaces(&self) -> Option<Surfaces<'_>> {
        assert!(self.acquired, "images are taken before they are drawn to");
        None
    }

    fn release(&mut self) -> Result<(), XrError> {
        assert!(self.acquired, "images are given back once");
        self.acquired = false;
        self.call("release")
    }

    fn look(&mut self, _time: FrameTime, _focused: bool) -> Result<Option<Look>, XrError> {
        self.call("look")?;
        let eye = EyePose { pose: RoomPose::ORIGIN, angles: [-0.6, 0.5, -0.7, 0.7] };
        let look = Look {
            eyes: [eye; 2],
            head: RoomPose::ORIGIN,
            hands: [HandPose::default(); 2],
            buttons: Buttons::default(),
        };
        Ok(Some(look).filter(|_| self.mishap != Mishap::Blind))
    }

    fn end_frame(&mut self, _time: FrameTime, drawn: Option<(&Look, [u32; 2])>) -> Result<(), XrError> {
        assert!(self.begun && !self.acquired, "a frame ends when its images are back");
        (self.waited, self.begun) = (false, false);
        self.call("end_frame")?;
        if drawn.is_some() {
            self.frames += 1;
            match self.mishap {
                Mishap::TakenOff(n) if n == self.frames => {
                    self.off = true;
                    self.queue(&[Visible, Synchronized, Stopping]);
                }
                Mishap::LossPending(n) if n == self.frames => self.queue(&[LossPending]),
                Mishap::InstanceLoss(n) if n == self.frames => self.events.push_back(Event::InstanceLoss),
                Mishap::Leaves(n) if n == self.frames => self.queue(&[Visible, Synchronized, Stopping]),
                _ => {}
            }
        }
        Ok(())
    }

    fn hidden(&mut self) -> [Vec<[[f64; 2]; 3]>; 2] {
        Default::default()
    }

    fn now(&self) -> Duration {
        self.clock
    }

    fn pause(&mut self, time: Duration) {
        self.clock += time;
    }
}

/// Paints nothing, or fails at its n-th frame.
#[derive(Default)]
struct Brush {
    painted: u32,
    fails_at: Option<u32>,
}

impl Painter for Brush {
    fn paint(&mut self, _: &Look, _: FrameTime, _: Option<Surfaces<'_>>) -> Result<Painted, XrError> {
        self.painted += 1;
        if self.fails_at == Some(self.painted) {
            return Err(XrError::Render(holonomy::render::RenderError::NothingLoaded));
        }
        Ok(Painted { size: [4, 3], bounces: 5, ..Painted::default() })
    }
}

fn play(mishap: Mishap, frames: Option<u32>) -> (Fake, Report, Result<(), XrError>) {
    let (mut fake, mut brush) = (Fake::new(mishap), Brush::default());
    let limits = Limits { frames, asleep: PATIENCE };
    let (report, ended) = run(&mut fake, &mut brush, limits);
    assert_eq!(report.frames.len() as u32, fake.frames, "frames are counted");
    (fake, report, ended)
}

fn told(ended: Result<(), XrError>) -> String {
    ended.expect_err("the session does not end well").to_string()
}

#[test]
fn xr_a_session_goes_through_its_states() {
    let (fake, report, ended) = play(Mishap::None, Some(60));
    ended.expect("it ends well");
    assert_eq!(fake.frames, 60);
    assert_eq!(
        report.states,
        [Idle, Ready, Synchronized, Visible, Focused, Visible, Synchronized, Stopping, Idle, Exiting]
    );
    assert_eq!(report.odd_changes, 0);
    assert!(!fake.running && !fake.begun && !fake.acquired);
    assert_eq!(report.frames.iter().map(|f| f.missed).sum::<u32>(), 0);
}

#[test]
fn xr_states_follow_each_other_as_the_specification_draws_them() {
    let arrows = [
        (Unknown, Idle),
        (Idle, Ready),
        (Idle, Exiting),
        (Ready, Synchronized),
        (Synchronized, Visible),
        (Synchronized, Stopping),
        (Visible, Focused),
        (Visible, Synchronized),
        (Focused, Visible),
        (Stopping, Idle),
    ];
    for from in STATES {
        for to in STATES {
            let known = to == LossPending || arrows.contains(&(from, to));
            assert_eq!(from.leads_to(to), known, "{} to {}", from.name(), to.name());
            // Whatever a runtime does, the program follows, and counts what is odd.
            let mut lifecycle = Lifecycle::default();
            lifecycle.enter(from);
            let odd = lifecycle.odd_changes();
            let running = lifecycle.is_running();
            let step = lifecycle.enter(to);
            assert_eq!(lifecycle.odd_changes() - odd, u32::from(!known));
            assert_eq!(lifecycle.state(), to);
            assert_eq!(lifecycle.is_focused(), to == Focused);
            let expected = match to {
                Ready if !running => Step::Begin,
                Stopping if running => Step::End,
                LossPending => Step::Quit(Ending::Lost),
                Exiting => Step::Quit(Ending::Exited),
                _ => Step::GoOn,
            };
            assert_eq!(step, expected, "{} to {}", from.name(), to.name());
            let runs = match to {
                Ready => true,
                Stopping | LossPending | Exiting => false,
                _ => running,
            };
            assert_eq!(lifecycle.is_running(), runs, "{} to {}", from.name(), to.name());
        }
    }
}

#[test]
fn xr_a_headset_that_sleeps_is_not_waited_for_for_ever() {
    for (mishap, state) in [(Mishap::Asleep, "idle"), (Mishap::Unseen, "focused"), (Mishap::Blind, "focused")] {
        let (fake, report, ended) = play(mishap, None);
        assert_eq!(told(ended), format!("the headset is asleep: for 5 s the session has been {state}"));
        assert!(report.frames.is_empty());
        assert!(fake.clock < Duration::from_secs(7), "{mishap:?}: {:?}", fake.clock);
        // Frames of a session that is not seen are begun and ended without pictures.
        assert_eq!(report.empty_frames > 100, mishap != Mishap::Asleep, "{}", report.empty_frames);
    }
}

#[test]
fn xr_a_headset_may_be_taken_off_and_put_on_again() {
    let (fake, report, ended) = play(Mishap::TakenOff(3), Some(8));
    ended.expect("it ends well");
    assert_eq!(fake.frames, 8);
    assert_eq!(fake.calls.iter().filter(|call| **call == "begin_session").count(), 2);
    assert_eq!(fake.calls.iter().filter(|call| **call == "end_session").count(), 2);
    assert_eq!(report.odd_changes, 0);
}

#[test]
fn xr_bad_ends_are_told_in_one_line() {
    assert_eq!(told(play(Mishap::LossPending(4), None).2), "the headset session was lost after 4 frames");
    assert_eq!(told(play(Mishap::InstanceLoss(2), None).2), "the OpenXR runtime is gone after 2 frames (loss pending)");
    assert_eq!(told(play(Mishap::Leaves(3), Some(9)).2), "the runtime ended the session after 3 of 9 frames");
    // Without a number of frames to draw, leaving is no failure.
    play(Mishap::Leaves(3), None).2.expect("it ends well");
    let (fake, _, ended) = play(Mishap::Stubborn, Some(2));
    assert_eq!(told(ended), "the runtime does not end the session, which is focused for 5 s");
    assert!(fake.clock < Duration::from_secs(7));
}

/// The session, or the runtime, goes at each call that there is, the first time and later: always one error, and never a call
/// that must not come any more.
#[test]
fn xr_any_call_may_be_the_last() {
    let calls = [
        "poll",
        "begin_session",
        "wait_frame",
        "begin_frame",
        "acquire",
        "look",
        "release",
        "end_frame",
        "request_exit",
        "end_session",
    ];
    for call in calls {
        for time in [1, 2, 5] {
            if matches!(call, "begin_session" | "request_exit" | "end_session") && time > 1 {
                continue;
            }
            let (fake, report, ended) = play(Mishap::Lost(call, time), Some(6));
            let drawn = report.frames.len();
            assert_eq!(told(ended), format!("the headset session was lost after {drawn} frames"), "{call} {time}");
            // An image that was taken is given back, whatever fails in between.
            assert!(!fake.acquired, "{call} {time}");
            let (fake, report, ended) = play(Mishap::Gone(call, time), Some(6));
            let drawn = report.frames.len();
            assert_eq!(told(ended), format!("the OpenXR runtime is gone after {drawn} frames ({call})"), "{time}");
            let last = fake.calls.iter().rfind(|last| **last != "release" || call == "release");
            assert_eq!(last, Some(&call), "nothing is asked for any more");
        }
    }
}

#[test]
fn xr_a_device_that_fails_gives_its_images_back() {
    let (mut fake, mut brush) = (Fake::new(Mishap::None), Brush { fails_at: Some(3), ..Brush::default() });
    let (report, ended) = run(&mut fake, &mut brush, Limits { frames: None, asleep: PATIENCE });
    assert_eq!(told(ended), "no scene is loaded");
    assert_eq!(report.frames.len(), 2);
    assert!(!fake.acquired && fake.calls.last() == Some(&"release"));
}

#[test]
fn xr_reports_hold_what_frames_cost() {
    let sorted: Vec<f64> = (1..=100).map(f64::from).collect();
    assert_eq!([0.5, 0.9, 0.99, 1.0, 0.0].map(|share| percentile(&sorted, share)), [50.0, 90.0, 99.0, 100.0, 1.0]);
    assert_eq!(percentile(&[], 0.5), 0.0);
    assert_eq!(percentile(&[7.0], 0.01), 7.0);
    let (_, mut report, _) = play(Mishap::None, Some(4));
    for (index, frame) in report.frames.iter_mut().enumerate() {
        frame.whole = Duration::from_millis(10 + index as u64);
        frame.painted.trace = Duration::from_millis(8);
        frame.missed = u32::from(index == 2) * 3;
    }
    let json = report_json(&report);
    assert_eq!(json["frames"], 4);
    assert_eq!(json["missed_frames"], 3);
    assert_eq!(json["frame_ms"]["max"], 13.0);
    assert_eq!(json["frame_ms"]["p50"], 11.0);
    assert_eq!(json["sizes"], serde_json::json!([[4, 3]]));
    assert_eq!(json["bounces"], serde_json::json!([5]));
    let share = json["share_not_tracing"].as_f64().expect("a number");
    assert!((share - (1.0 - 32.0 / 46.0)).abs() < 1e-9, "{share}");
}

#[test]
fn xr_takes_the_first_format_of_the_runtime_that_can_be_filled() {
    use ash::vk::Format;
    let numbers = |formats: &[Format]| formats.iter().map(|f| f.as_raw() as u32).collect::<Vec<_>>();
    let chosen = |formats: &[Format]| color_format(&numbers(formats)).map(|(_, encoding)| encoding);
    let [half, srgb, blue] = [Format::R16G16B16A16_SFLOAT, Format::R8G8B8A8_SRGB, Format::B8G8R8A8_SRGB];
    assert_eq!(chosen(&[Format::R5G6B5_UNORM_PACK16, srgb, half]), Some(Encoding::Rgba8Srgb));
    assert_eq!(chosen(&[half, srgb]), Some(Encoding::Rgba16F));
    assert_eq!(chosen(&[blue, srgb]), Some(Encoding::Bgra8Srgb));
    assert_eq!(chosen(&[Format::D32_SFLOAT]), None);
    assert_eq!(chosen(&[]), None);
    assert!(depth_format(&numbers(&[Format::D16_UNORM, Format::D32_SFLOAT])).is_some());
    assert!(depth_format(&numbers(&[Format::D16_UNORM, half])).is_none());
}

/// Rays of a list, as eye, column and row.
fn listed(rays: &Rays) -> Vec<(u32, u32, u32)> {
    let Rays::Listed(list) = rays else { panic!("a list") };
    let mask = (1 << LIST_BITS) - 1;
    list.rays.iter().map(|ray| (ray >> (2 * LIST_BITS), ray & mask, ray >> LIST_BITS & mask)).collect()
}

#[test]
fn xr_hidden_pixels_have_no_rays() {
    let tangents = [-1.0, 1.0, -1.0, 1.0];
    let plain = Sight { tangents, ..Sight::default() };
    assert_eq!(Rays::new(&[plain.clone(), plain.clone()], [20, 10]), Rays::All);
    // The upper right half of the left eye is hidden, whichever way round the triangle is.
    for corners in [[[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]], [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]] {
        let half = Sight { hidden: vec![corners], ..plain.clone() };
        let rays = Rays::new(&[half, plain.clone()], [20, 20]);
        let left: Vec<_> = listed(&rays).into_iter().filter(|ray| ray.0 == 0).collect();
        // Pixel (x, y) has its centre above the diagonal from the upper left to the lower right corner for x > y.
        assert!(left.iter().all(|(_, x, y)| x <= y));
        assert_eq!(left.len(), 210);
        assert_eq!(rays.count([20, 20]), 210 + 400);
        let Rays::Listed(list) = &rays else { panic!("a list") };
        assert_eq!(list.of_first, 210);
        // The square at the upper right is hidden altogether.
        assert_eq!(list.rates[..9], [1, 0, 0, 1, 1, 0, 1, 1, 1]);
    }
}

#[test]
fn xr_rays_thin_out_away_from_the_middle() {
    let size = [160, 128];
    let sight = |tangents| Sight { tangents, full_rate_within: Some(0.2), hidden: Vec::new() };
    let eyes = [sight([-1.0, 0.6, -0.8, 0.7]), sight([-0.6, 1.0, -0.8, 0.7])];
    let rays = Rays::new(&eyes, size);
    let Rays::Listed(list) = &rays else { panic!("a list") };
    let traced: std::collections::HashSet<_> = listed(&rays).into_iter().collect();
    assert_eq!(traced.len(), list.rays.len(), "no ray twice");
    let tiles = size.map(|side| side.div_ceil(RATE_TILE));
    for (index, eye) in eyes.iter().enumerate() {
        for y in 0..size[1] {
            for x in 0..size[0] {
                let tile = (index as u32 * tiles[1] + y / RATE_TILE) * tiles[0] + x / RATE_TILE;
                let rate = list.rates[tile as usize];
                let here = traced.contains(&(index as u32, x, y));
                assert_eq!(here, x.is_multiple_of(rate) && y.is_multiple_of(rate), "({x}, {y}) at rate {rate}");
                let [left, right, down, up] = eye.tangents;
                let slope_x = left + (right - left) * (f64::from(x) + 0.5) / f64::from(size[0]);
                let slope_y = up + (down - up) * (f64::from(y) + 0.5) / f64::from(size[1]);
                let angle = slope_x.hypot(slope_y).atan();
                assert!(angle > 0.2 || rate == 1, "the middle has all rays");
                assert!(angle > 0.4 || rate <= 2, "then a quarter");
                assert!(angle < 0.6 || rate == 4, "then a sixteenth");
            }
        }
    }
    assert!(list.rays.len() < 160 * 128);
}

#[test]
fn xr_hold_finds_what_the_machine_can_do() {
    // A machine whose frames take time with pixels and with bounces.
    let cost = |hold: &Hold, slow: f64| {
        Duration::from_secs_f64(slow * hold.scale().powi(2) * (1.0 + f64::from(hold.bounces())))
    };
    let settle = |hold: &mut Hold, slow: f64| {
        for _ in 0..2000 {
            hold.learn(cost(hold, slow));
        }
    };
    let mut hold = Hold::new(72.0, 12);
    settle(&mut hold, 1e-5);
    assert_eq!((hold.scale(), hold.bounces()), (1.0, 12), "a fast machine gives nothing up");
    settle(&mut hold, 3e-3);
    assert!(cost(&hold, 3e-3).as_secs_f64() < 1.0 / 72.0, "a slow one holds the rate");
    assert!(hold.scale() < 1.0 && hold.bounces() < 12, "by both");
    let held = (hold.scale(), hold.bounces());
    settle(&mut hold, 3e-3);
    assert_eq!((hold.scale(), hold.bounces()), held, "and does not waver");
    settle(&mut hold, 1.0);
    assert_eq!((hold.scale(), hold.bounces()), (0.5, 2), "a hopeless one ends at the least");
    settle(&mut hold, 1e-5);
    assert_eq!((hold.scale(), hold.bounces()), (1.0, 12), "all comes back when there is time");
}

#[test]
fn xr_watchdog_barks_at_calls_that_hang() {
    let (sender, barks) = mpsc::channel();
    let watchdog = Watchdog::with_limit(Duration::from_millis(20), move |call| sender.send(call).expect("heard"));
    // Calls that come back are no reason, however many there are.
    for _ in 0..1000 {
        watchdog.watch("quick", || ());
    }
    assert_eq!(watchdog.watch("slow", || barks.recv_timeout(Duration::from_secs(60))), Ok("slow"));
    drop(watchdog);
    assert!(barks.recv_timeout(Duration::from_secs(60)).is_err(), "it barks once, and goes");
}

#[test]
fn xr_buttons_move_as_they_say() {
    let mut buttons = Buttons { forward: [0.5, f64::NAN], ..Buttons::default() };
    assert!(buttons.pulling(0) > 0.7 && buttons.pulling(1) == 0.0);
    assert_eq!((buttons.walking(), buttons.turning()), (0.0, 0.0));
    buttons.stick = [[0.1, 0.1], [-0.1, 0.0]];
    assert_eq!((buttons.walking(), buttons.turning()), (0.0, 0.0), "worn sticks are at rest");
    buttons.stick = [[1.0, 0.0], [0.0, -1.0]];
    assert!(buttons.turning() < 0.0, "to the right");
    assert!(buttons.walking() < 0.0, "backwards");
    buttons.stick = [[1.0, 1.0], [1.0, 1.0]];
    assert!(buttons.walking() <= 1.5 && buttons.turning() >= -1.5, "two sticks are not faster");
    // Five kinds of controllers, each with all that a hand does.
    let known = ["khr/simple", "htc/vive", "valve/index", "oculus/touch", "microsoft/motion"];
    for (profile, name) in PROFILES.iter().zip(known) {
        assert_eq!(profile.path, format!("/interaction_profiles/{name}_controller"));
        let paths = profile.forward.iter().chain(&profile.recentre).chain(&profile.stick);
        assert!(paths.into_iter().all(|path| path.starts_with("/input/")));
        assert!(profile.stick.is_some() != name.starts_with("khr"));
    }
    assert_eq!(PROFILES.len(), known.len());
}

#[test]
fn xr_refuses_poses_that_are_none() {
    let pose = |x: f64, rotation| RoomPose { position: DVec3::new(x, 0.0, 0.0), rotation };
    assert!(pose(1.0, DQuat::IDENTITY).is_sound());
    assert!(!pose(f64::NAN, DQuat::IDENTITY).is_sound());
    assert!(!pose(1e9, DQuat::IDENTITY).is_sound());
    assert!(!pose(0.0, DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)).is_sound());
    let eye = |angles| EyePose { pose: RoomPose::ORIGIN, angles };
    assert!(eye([-0.9, 0.7, -0.8, 0.8]).is_sound());
    assert!(!eye([0.7, -0.9, -0.8, 0.8]).is_sound(), "left of right");
    assert!(!eye([-0.9, 0.7, 0.8, 0.8]).is_sound(), "empty");
    assert!(!eye([-1.6, 0.7, -0.8, 0.8]).is_sound(), "more than half a turn");
    assert!(!eye([f64::NAN; 4]).is_sound());
}

/// What is refused is refused before a runtime is looked for, and a machine without one says so.
#[test]
fn xr_refusals_and_machines_without_a_runtime() {
    let place = tempfile::tempdir().expect("a folder");
    let vr = |args: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_holonomy"))
            .arg("vr")
            .args(args)
            .current_dir(place.path())
            .env("XR_RUNTIME_JSON", place.path().join("nothing.json"))
            .env("XDG_RUNTIME_DIR", place.path())
            .output()
            .expect("it runs");
        let words = String::from_utf8(output.stderr).expect("text");
        let own = words.lines().filter_map(|line| line.strip_prefix("holonomy: ")).next_back();
        (output.status.code(), own.unwrap_or_default().to_owned())
    };
    for (args, words) in [
        (&["torus", "--backend", "cpu"][..], "--backend cpu draws no frames for a headset: use rt, compute or auto"),
        (&["toros"], "toros: no such file, and no scene of this name: did you mean \"torus\"?"),
        (
            &["torus", "--resolution-scale", "7"],
            "invalid value '7' for '--resolution-scale <SHARE>': expected a number from 0.05 to 2",
        ),
        (&["torus", "--stats", "nowhere/stats.json"], "nowhere/stats.json: there is no folder nowhere"),
    ] {
        let (code, line) = vr(args);
        assert_eq!((code, line.as_str()), (Some(1), words), "{args:?}");
    }
    let (code, line) = vr(&["torus", "--frames", "1", "--stats", "stats.json"]);
    assert_eq!(code, Some(2), "{line}");
    assert!(line.starts_with("no OpenXR"), "{line}");
    assert_eq!(std::fs::read_dir(place.path()).expect("a folder").count(), 0, "nothing is left lying about");
}

/// A device that is lost in the middle of a frame is told, call by call, and nothing is drawn without a scene.
#[test]
fn xr_eyes_tell_of_a_lost_device() {
    use crate::support::gpu_turn;
    use ash::vk::Result as Code;
    use holonomy::{
        render::{
            Backend, Shot,
            compute::ComputeBackend,
            device::eyes::{EyeBackend, EyeLayout, EyeOptions},
            plan::{Plan, Purpose},
            world::{Pose, World},
        },
        scene::file,
        vulkan::Context,
    };
    let Some((_turn, options)) = gpu_turn() else { return };
    let (faults, messages) = (options.faults.clone(), options.messages.clone());
    let context = Context::new(&options).expect("a device");
    let mut backend = ComputeBackend::new(&context).expect("a backend");
    let scene = file::load("torus").expect("a scene");
    let plan = Plan::new(&scene, false).serving(Purpose::Eyes { listed: false });
    let pose = Pose::new(scene.observer.frame, 0.0);
    let world = std::sync::Arc::new(World::moving(&scene, &plan, pose).expect("a world"));
    let size = [24, 16];
    let layout = EyeLayout { size, largest: size, encoding: Encoding::Rgba16F, depth: None, rays: Rays::All };
    let shot = Shot { eye: pose.observer, tangents: [-1.0, 0.8, -0.9, 0.9], size, samples: 1, seed: 0, bounces: None };
    let options = EyeOptions { bounces: Some(2), together: true, read_back: false };
    assert_eq!(backend.set_eyes(layout.clone()).expect_err("no scene").to_string(), "no scene is loaded");
    backend.load(&world).expect("loaded");
    backend.set_eyes(layout).expect("set");
    let together = backend.draw_eyes(&[shot; 2], None, options).expect("drawn");
    let apart = backend.draw_eyes(&[shot; 2], None, EyeOptions { together: false, ..options }).expect("drawn");
    assert!(together.dispatches > 0 && apart.dispatches >= 2);
    for call in ["vkQueueSubmit", "vkWaitForFences", "vkResetCommandPool"] {
        faults.fail(call, 1, Code::ERROR_DEVICE_LOST);
        let error = backend.draw_eyes(&[shot; 2], None, options).expect_err("the device is lost").to_string();
        assert!(
            error.starts_with(call) && error.ends_with("ERROR_DEVICE_LOST") && error.lines().count() == 1,
            "{error}"
        );
        faults.clear();
        backend.draw_eyes(&[shot; 2], None, options).expect("drawn again");
    }
    drop((backend, context));
    assert_eq!(messages.all(), Vec::<String>::new());
}

/// What a launch needs for itself may be more than a device binds, where its pixels are not: eyes are drawn in slices then.
#[test]
fn xr_eyes_are_drawn_in_slices_where_one_launch_needs_too_much() {
    use crate::support::gpu_turn;
    use holonomy::{
        render::{
            Backend, RenderError, Shot,
            compute::{ComputeBackend, ComputeOptions},
            device::eyes::{EyeBackend, EyeLayout, EyeOptions},
            plan::{Plan, Purpose},
            world::{Pose, World},
        },
        scene::file,
        vulkan::{Context, ContextOptions, DeviceKind},
    };
    let Some((_turn, options)) = gpu_turn() else { return };
    let mut scene = file::load("torus").expect("a scene");
    // Boxes of tubes are all that the device must hold, and are walked with a stack of 64 bytes or more.
    scene.objects.retain(|object| !object.shape.is_flat());
    let plan = Plan::new(&scene, false).serving(Purpose::Eyes { listed: false });
    let pose = Pose::new(scene.observer.frame, 0.0);
    let world = std::sync::Arc::new(World::moving(&scene, &plan, pose).expect("a world"));
    // The stacks of a pixel's group are as many as those of 64 pixels: 1 MiB or more, beside 128 KiB of pixels.
    let size = [1, 4096];
    let layout = EyeLayout { size, largest: size, encoding: Encoding::Rgba16F, depth: None, rays: Rays::All };
    let shot = Shot { eye: pose.observer, tangents: [-1.0, 0.8, -0.9, 0.9], size, samples: 1, seed: 0, bounces: None };
    let draw = |max_storage_range| -> Result<u32, RenderError> {
        let context = Context::new(&ContextOptions { max_storage_range, ..options.clone() }).expect("a device");
        assert_eq!(context.info().kind, DeviceKind::Cpu, "the tests' device is software");
        let together = ComputeOptions { together: Some(true) };
        let mut backend = ComputeBackend::with_options(&context, together).expect("a backend");
        backend.load(&world)?;
        backend.set_eyes(layout.clone())?;
        let options = EyeOptions { bounces: Some(0), together: true, read_back: false };
        // The first frames are in slices because nothing is known of their cost, or as they compile.
        let mut frames = (0..10).map(|_| backend.draw_eyes(&[shot; 2], None, options));
        frames.try_fold(u32::MAX, |least, frame| Ok(least.min(frame?.dispatches)))
    };
    assert_eq!(draw(None).expect("drawn"), 1);
    assert!(draw(Some(1 << 17)).expect("drawn") >= 4);
    assert_eq!(options.messages.all(), Vec::<String>::new());
}
