//! The player's hands and buttons, as actions of the runtime.

use super::{
    error::XrError,
    frames::HandPose,
    input::{AIM, Buttons, GRIP, PROFILES},
    system::{failed, room_pose},
};
use openxr::{
    Action, ActionSet, ActiveActionSet, Binding, Hand, HandJoint, HandTracker, Instance, Path, Posef, Session, Space,
    SpaceLocationFlags, Time, Vector2f, Vulkan,
};

const HANDS: [&str; 2] = ["/user/hand/left", "/user/hand/right"];

/// Thumb and index finger nearer than this, in metres, pull the trigger of a hand without a controller.
const PINCH: f64 = 0.02;

/// Actions of a session.
pub struct Actions {
    set: ActionSet,
    hands: [Path; 2],
    forward: Action<f32>,
    stick: Action<Vector2f>,
    recentre: Action<bool>,
    grip: Action<Posef>,
    aim: Action<Posef>,
    grips: [Space; 2],
    aims: [Space; 2],
    /// Hands without controllers, where the runtime sees them.
    trackers: Option<[HandTracker; 2]>,
}

impl Actions {
    /// Declares the actions, suggests bindings for all known controllers, and attaches them to the session.
    ///
    /// # Errors
    /// The runtime's.
    pub fn new(instance: &Instance, session: &Session<Vulkan>, track_hands: bool) -> Result<Self, XrError> {
        let path = |text: &str| instance.string_to_path(text).map_err(|r| failed("xrStringToPath", r));
        let hands = [path(HANDS[0])?, path(HANDS[1])?];
        let set = instance.create_action_set("player", "Player", 0).map_err(|r| failed("xrCreateActionSet", r))?;
        let action = |r| failed("xrCreateAction", r);
        let forward = set.create_action::<f32>("forward", "Go where the hand points", &hands).map_err(action)?;
        let stick = set.create_action::<Vector2f>("stick", "Turn and walk", &hands).map_err(action)?;
        let recentre = set.create_action::<bool>("recentre", "Back to the start", &hands).map_err(action)?;
        let grip = set.create_action::<Posef>("grip", "Hand", &hands).map_err(action)?;
        let aim = set.create_action::<Posef>("aim", "Direction of the hand", &hands).map_err(action)?;
        for profile in PROFILES {
            let mut bindings = Vec::new();
            for (index, hand) in HANDS.iter().enumerate() {
                let at = |part: &str| path(&format!("{hand}{part}"));
                bindings.push(Binding::new(&forward, at(profile.forward[index])?));
                bindings.push(Binding::new(&recentre, at(profile.recentre[index])?));
                bindings.push(Binding::new(&grip, at(GRIP)?));
                bindings.push(Binding::new(&aim, at(AIM)?));
                if let Some(part) = profile.stick {
                    bindings.push(Binding::new(&stick, at(part)?));
                }
            }
            let suggested = instance.suggest_interaction_profile_bindings(path(profile.path)?, &bindings);
            match suggested {
                // A controller that this runtime does not know.
                Ok(()) | Err(openxr::sys::Result::ERROR_PATH_UNSUPPORTED) => {}
                Err(result) => return Err(failed("xrSuggestInteractionProfileBindings", result)),
            }
        }
        session.attach_action_sets(&[&set]).map_err(|r| failed("xrAttachSessionActionSets", r))?;
        let space = |action: &Action<Posef>, hand: usize| {
            action.create_space(session, hands[hand], Posef::IDENTITY).map_err(|r| failed("xrCreateActionSpace", r))
        };
        let grips = [space(&grip, 0)?, space(&grip, 1)?];
        let aims = [space(&aim, 0)?, space(&aim, 1)?];
        let tracker = |hand| session.create_hand_tracker(hand).ok();
        let trackers = if track_hands { tracker(Hand::LEFT).zip(tracker(Hand::RIGHT)).map(Into::into) } else { None };
        Ok(Self { set, hands, forward, stick, recentre, grip, aim, grips, aims, trackers })
    }

    /// What is pressed; nothing without the session's focus.
    ///
    /// # Errors
    /// The runtime's.
    pub fn buttons(&self, session: &Session<Vulkan>, focused: bool) -> Result<Buttons, XrError> {
        let mut buttons = Buttons::default();
        match session.sync_actions(&[ActiveActionSet::new(&self.set)]) {
            Ok(()) if focused => {}
            Ok(()) => return Ok(buttons),
            Err(result) => return Err(failed("xrSyncActions", result)),
        }
        for (index, hand) in self.hands.into_iter().enumerate() {
            let state = |r| failed("xrGetActionState", r);
            buttons.forward[index] = f64::from(self.forward.state(session, hand).map_err(state)?.current_state);
            let stick = self.stick.state(session, hand).map_err(state)?.current_state;
            buttons.stick[index] = [f64::from(stick.x), f64::from(stick.y)];
            buttons.recentre |= self.recentre.state(session, hand).map_err(state)?.current_state;
        }
        Ok(buttons)
    }

    /// Where the hands are: what the controllers say, else what the runtime sees of the hands, whose pinch counts as a
    /// trigger.
    ///
    /// # Errors
    /// The runtime's.
    pub fn hands(
        &self,
        session: &Session<Vulkan>,
        base: &Space,
        time: Time,
        buttons: &mut Buttons,
    ) -> Result<[HandPose; 2], XrError> {
        let mut hands = [HandPose::default(); 2];
        for (index, hand) in hands.iter_mut().enumerate() {
            let located = |action: &Action<Posef>, space: &Space| -> Result<_, XrError> {
                if !action.is_active(session, self.hands[index]).map_err(|r| failed("xrGetActionStatePose", r))? {
                    return Ok(None);
                }
                let location = space.locate(base, time).map_err(|r| failed("xrLocateSpace", r))?;
                Ok(known(location.location_flags).then(|| room_pose(location.pose)).filter(|pose| pose.is_sound()))
            };
            hand.grip = located(&self.grip, &self.grips[index])?;
            hand.aim = located(&self.aim, &self.aims[index])?;
            if let (None, Some(trackers)) = (hand.grip, &self.trackers) {
                let joints = base.locate_hand_joints(&trackers[index], time);
                let Some(joints) = joints.map_err(|r| failed("xrLocateHandJointsEXT", r))? else { continue };
                let joint = |joint: HandJoint| {
                    let at = joints[joint];
                    known(at.location_flags).then(|| room_pose(at.pose)).filter(|pose| pose.is_sound())
                };
                hand.grip = joint(HandJoint::PALM);
                hand.aim = hand.grip;
                let tips = joint(HandJoint::THUMB_TIP).zip(joint(HandJoint::INDEX_TIP));
                if tips.is_some_and(|(thumb, index)| thumb.position.distance(index.position) < PINCH) {
                    buttons.forward[index] = 1.0;
                }
            }
        }
        Ok(hands)
    }
}

/// Whether both position and orientation are known.
pub fn known(flags: SpaceLocationFlags) -> bool {
    flags.contains(SpaceLocationFlags::POSITION_VALID | SpaceLocationFlags::ORIENTATION_VALID)
}
