//! What a player does with the controllers, and which part of which controller means it.

/// What is pressed when a frame is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Buttons {
    /// How far each trigger is pulled, from 0 to 1: left, right.
    pub forward: [f64; 2],
    /// The sticks, right and up, from −1 to 1: left, right.
    pub stick: [[f64; 2]; 2],
    /// Whether a button that recentres is down.
    pub recentre: bool,
}

/// Metres per second with a trigger pulled or a stick pushed all the way.
pub const WALKING_SPEED: f64 = 1.5;

/// Radians per second with a stick pushed to the side all the way.
pub const TURNING_SPEED: f64 = 1.5;

/// A stick that is pushed less is at rest: worn ones do not come back to 0.
const DEAD_ZONE: f64 = 0.15;

impl Buttons {
    /// How fast the body turns to the left, in radians per second: both sticks count.
    pub fn turning(&self) -> f64 {
        -TURNING_SPEED * (live(self.stick[0][0]) + live(self.stick[1][0])).clamp(-1.0, 1.0)
    }

    /// How fast the body walks to where the head looks, in metres per second: both sticks count.
    pub fn walking(&self) -> f64 {
        WALKING_SPEED * (live(self.stick[0][1]) + live(self.stick[1][1])).clamp(-1.0, 1.0)
    }

    /// How fast the body moves to where a hand points, in metres per second.
    pub fn pulling(&self, hand: usize) -> f64 {
        let pulled = self.forward[hand];
        if pulled.is_finite() { WALKING_SPEED * pulled.clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// A stick's deflection outside of its dead zone.
fn live(deflection: f64) -> f64 {
    if !deflection.is_finite() || deflection.abs() < DEAD_ZONE { 0.0 } else { deflection.clamp(-1.0, 1.0) }
}

/// What an action is bound to on one kind of controller, below `/user/hand/left` and `/user/hand/right`.
#[derive(Clone, Copy, Debug)]
pub struct Profile {
    /// Path of the interaction profile.
    pub path: &'static str,
    /// Goes forward, for the left and the right hand.
    pub forward: [&'static str; 2],
    /// Turns and walks.
    pub stick: Option<&'static str>,
    /// Recentres, for the left and the right hand.
    pub recentre: [&'static str; 2],
}

/// Where all controllers say how they are held and where they point.
pub const GRIP: &str = "/input/grip/pose";

/// See [`GRIP`].
pub const AIM: &str = "/input/aim/pose";

/// The controllers that are known.
pub const PROFILES: &[Profile] = &[
    Profile {
        path: "/interaction_profiles/khr/simple_controller",
        forward: ["/input/select/click"; 2],
        stick: None,
        recentre: ["/input/menu/click"; 2],
    },
    Profile {
        path: "/interaction_profiles/htc/vive_controller",
        forward: ["/input/trigger/value"; 2],
        stick: Some("/input/trackpad"),
        recentre: ["/input/menu/click"; 2],
    },
    Profile {
        path: "/interaction_profiles/valve/index_controller",
        forward: ["/input/trigger/value"; 2],
        stick: Some("/input/thumbstick"),
        recentre: ["/input/a/click"; 2],
    },
    Profile {
        path: "/interaction_profiles/oculus/touch_controller",
        forward: ["/input/trigger/value"; 2],
        stick: Some("/input/thumbstick"),
        recentre: ["/input/x/click", "/input/a/click"],
    },
    Profile {
        path: "/interaction_profiles/microsoft/motion_controller",
        forward: ["/input/trigger/value"; 2],
        stick: Some("/input/thumbstick"),
        recentre: ["/input/menu/click"; 2],
    },
];
