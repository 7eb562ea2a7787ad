//! Draws what a player sees: his body in the space, what hangs off it, and both eyes in one dispatch.

use super::{
    error::XrError,
    frames::{EyePose, FrameTime, HandPose, Look, Painted, Painter},
    hold::Hold,
    input::Buttons,
};
use crate::{
    render::{
        Shot,
        device::{
            eyes::{DepthScale, Encoding, EyeBackend, EyeLayout, EyeOptions, Surfaces},
            rays::{Rays, Sight},
        },
        plan::{Plan, Purpose},
        world::{Pose, World},
    },
    scene::{Object, Scene},
    space::{
        body::{Body, RoomPose, Tracking},
        domain::Domain,
        observer::Frame,
    },
};
use glam::DVec3;
use std::{sync::Arc, time::Instant};

/// What the user has chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct PlayerOptions {
    /// How the head's motion becomes a motion in the space.
    pub tracking: Tracking,
    /// Metres in a unit of length.
    pub unit_in_metres: f64,
    /// Width and height of an eye at full resolution.
    pub size: [u32; 2],
    /// Angle from the view axis, in radians, within which each pixel has a ray; all have one if none.
    pub full_rate_within: Option<f64>,
    /// Frames per second that are held by giving up resolution and bounces.
    pub hold_fps: Option<f64>,
    /// Both eyes in one dispatch.
    pub together: bool,
    /// Keeps the images of the last frame, with what is needed to draw them again.
    pub keep: bool,
}

/// The last frame, to be drawn again elsewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptFrame {
    /// Bytes of the images as they were handed to the runtime, left and right.
    pub images: [Vec<u8>; 2],
    /// How colours are stored in them.
    pub encoding: Encoding,
    /// What was taken with each eye.
    pub shots: [Shot; 2],
    /// Where observer and hands were, and the time.
    pub pose: Pose,
    /// Largest number of face passages.
    pub bounces: u32,
    /// What the runtime said.
    pub look: Look,
}

/// A player in a scene.
pub struct Player {
    scene: Scene,
    domain: Domain,
    plan: Plan,
    backend: Box<dyn EyeBackend>,
    options: PlayerOptions,
    encoding: Encoding,
    depth: Option<DepthScale>,
    body: Body,
    /// Nothing is loaded before the first frame.
    world: Option<Arc<World>>,
    layout: Option<EyeLayout>,
    hidden: [Vec<[[f64; 2]; 3]>; 2],
    last_tangents: Option<[[f64; 4]; 2]>,
    hold: Option<Hold>,
    recentring: bool,
    first_display: Option<i64>,
    last_display: Option<i64>,
    kept: Option<KeptFrame>,
}

/// Longest time that a step of walking or turning stands for: after a pause the player does not leap.
const LONGEST_STEP: f64 = 0.1;

impl Player {
    /// A player where the scene's observer is.
    pub fn new(scene: Scene, backend: Box<dyn EyeBackend>, options: PlayerOptions) -> Self {
        let domain = Domain::new(&scene.space);
        let body = Body::new(scene.space.geometry, scene.observer.frame, options.tracking, options.unit_in_metres);
        let hold = options.hold_fps.map(|fps| Hold::new(fps, scene.settings.bounces));
        Self {
            plan: Plan::new(&scene, false),
            domain,
            backend,
            body,
            hold,
            options,
            encoding: Encoding::Rgba8Srgb,
            depth: None,
            world: None,
            layout: None,
            hidden: Default::default(),
            last_tangents: None,
            recentring: false,
            first_display: None,
            last_display: None,
            kept: None,
            scene,
        }
    }

    /// What the runtime's images are like.
    pub fn set_images(&mut self, encoding: Encoding, depth: Option<DepthScale>) {
        (self.encoding, self.depth) = (encoding, depth);
    }

    /// How colours are stored in the runtime's images.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// The backend.
    pub fn backend(&self) -> &dyn EyeBackend {
        &*self.backend
    }

    /// The last frame, if frames are kept.
    pub fn kept(&self) -> Option<&KeptFrame> {
        self.kept.as_ref()
    }

    /// The body.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Rays of a frame.
    pub fn rays(&self) -> u64 {
        self.layout.as_ref().map_or(0, |layout| layout.rays.count(layout.size))
    }

    /// Draws a frame for nobody, so that drivers compile before the session asks for frames. What the headset hides
    /// should be known before: see [`Painter::hide`].
    ///
    /// # Errors
    /// Device faults.
    pub fn warm_up(&mut self) -> Result<(), XrError> {
        let eye = EyePose { pose: RoomPose::ORIGIN, angles: [-0.7, 0.7, -0.7, 0.7] };
        let look = Look {
            eyes: [eye; 2],
            head: RoomPose::ORIGIN,
            hands: [HandPose { grip: Some(RoomPose::ORIGIN), aim: None }; 2],
            buttons: Buttons::default(),
        };
        let pose = self.pose(&look, FrameTime { display: 0, period: 0, should_render: true })?;
        self.load(&look, pose)?;
        let frame = self.body.head(&self.domain)?;
        let shot = Shot { eye: frame, tangents: eye.tangents(), size: self.size(), samples: 1, seed: 0, bounces: None };
        let options = EyeOptions { bounces: Some(1), together: self.options.together, read_back: false };
        self.backend.draw_eyes(&[shot; 2], None, options)?;
        (self.first_display, self.layout) = (None, None);
        Ok(())
    }

    /// Moves the body: as the head has moved, and as buttons say.
    fn move_body(&mut self, look: &Look, time: FrameTime) -> Result<(), XrError> {
        let since_last = self.last_display.map_or(0, |last| time.display.saturating_sub(last));
        let step = (since_last as f64 * 1e-9).clamp(0.0, LONGEST_STEP);
        self.last_display = Some(time.display);
        if look.buttons.recentre && !self.recentring {
            self.body.recentre(look.head, self.scene.observer.frame);
        }
        self.recentring = look.buttons.recentre;
        self.body.track(&self.domain, look.head)?;
        let angle = look.buttons.turning() * step;
        if angle != 0.0 {
            self.body.turn_left(&self.domain, angle)?;
        }
        let mut way = look.head.rotation * DVec3::NEG_Z * (look.buttons.walking() * step);
        for (index, hand) in look.hands.iter().enumerate() {
            if let Some(aim) = hand.aim {
                way += aim.rotation * DVec3::NEG_Z * (look.buttons.pulling(index) * step);
            }
        }
        if way != DVec3::ZERO {
            self.body.walk(&self.domain, way)?;
        }
        Ok(())
    }

    /// Where everything of the player is in the space.
    fn pose(&mut self, look: &Look, time: FrameTime) -> Result<Pose, XrError> {
        let first = *self.first_display.get_or_insert(time.display);
        let hand = |hand: &HandPose| -> Result<Option<Frame>, XrError> {
            hand.grip.map(|grip| self.body.place(&self.domain, grip)).transpose().map_err(XrError::from)
        };
        Ok(Pose {
            observer: self.body.head(&self.domain)?,
            time: (time.display.saturating_sub(first)) as f64 * 1e-9,
            hands: [hand(&look.hands[0])?, hand(&look.hands[1])?],
        })
    }

    /// Width and height of an eye in the next frame.
    fn size(&self) -> [u32; 2] {
        let scale = self.hold.as_ref().map_or(1.0, Hold::scale);
        self.options.size.map(|side| ((f64::from(side) * scale).round() as u32).max(1))
    }

    /// The rays and the size of the next frame.
    fn wanted_layout(&self, look: &Look) -> EyeLayout {
        let size = self.size();
        let sight = |eye: usize| Sight {
            tangents: look.eyes[eye].tangents(),
            hidden: self.hidden[eye].clone(),
            full_rate_within: self.options.full_rate_within,
        };
        let rays = Rays::new(&[sight(0), sight(1)], size);
        EyeLayout { size, largest: self.options.size, encoding: self.encoding, depth: self.depth, rays }
    }

    /// Brings the scene and what is drawn of it up to date.
    fn load(&mut self, look: &Look, pose: Pose) -> Result<(), XrError> {
        // Lists of rays are only made again where what they depend on has changed.
        let size = self.size();
        let lists = self.options.full_rate_within.is_some() || self.hidden.iter().any(|h| !h.is_empty());
        let stale =
            self.layout.as_ref().is_none_or(|layout| layout.size != size || lists == (layout.rays == Rays::All));
        let layout = if stale || self.tangents_changed(look, lists) { Some(self.wanted_layout(look)) } else { None };
        let purpose = Purpose::Eyes { listed: lists };
        match &self.world {
            Some(world) if world.plan.purpose == purpose => {
                if self.scene.objects.iter().any(Object::moves) {
                    let world = Arc::new(world.posed(&self.scene, pose)?);
                    self.backend.as_backend().pose(&world)?;
                    self.world = Some(world);
                }
            }
            _ => {
                let plan = self.plan.clone().serving(purpose);
                let world = Arc::new(World::moving(&self.scene, &plan, pose)?);
                self.backend.as_backend().load(&world)?;
                self.world = Some(world);
            }
        }
        if let Some(layout) = layout {
            self.backend.set_eyes(layout.clone())?;
            self.layout = Some(layout);
        }
        Ok(())
    }

    /// Whether lists of rays are for other frusta. Headsets hardly ever change theirs.
    fn tangents_changed(&mut self, look: &Look, lists: bool) -> bool {
        let tangents = [look.eyes[0].tangents(), look.eyes[1].tangents()];
        lists && self.last_tangents.replace(tangents).is_some_and(|last| last != tangents)
    }
}

impl Painter for Player {
    fn paint(&mut self, look: &Look, time: FrameTime, surfaces: Option<Surfaces<'_>>) -> Result<Painted, XrError> {
        let started = Instant::now();
        self.move_body(look, time)?;
        let pose = self.pose(look, time)?;
        self.load(look, pose)?;
        let size = self.layout.as_ref().map_or(self.options.size, |layout| layout.size);
        let shot = |eye: usize| -> Result<Shot, XrError> {
            let frame = self.body.place(&self.domain, look.eyes[eye].pose)?;
            Ok(Shot { eye: frame, tangents: look.eyes[eye].tangents(), size, samples: 1, seed: 0, bounces: None })
        };
        let shots = [shot(0)?, shot(1)?];
        let place = started.elapsed();
        let bounces = self.hold.as_ref().map_or(self.scene.settings.bounces, Hold::bounces);
        let options =
            EyeOptions { bounces: Some(bounces), together: self.options.together, read_back: self.options.keep };
        let mut drawn = self.backend.draw_eyes(&shots, surfaces, options)?;
        if let Some(images) = drawn.images.take() {
            let (encoding, look) = (self.encoding, *look);
            self.kept = Some(KeptFrame { images, encoding, shots, pose, bounces, look });
        }
        if let Some(hold) = &mut self.hold {
            hold.learn(started.elapsed());
        }
        Ok(Painted { size, bounces, trace: drawn.trace, finish: drawn.finish, place })
    }

    fn hide(&mut self, hidden: [Vec<[[f64; 2]; 3]>; 2]) {
        if self.hidden != hidden {
            self.hidden = hidden;
            self.layout = None;
        }
    }
}
