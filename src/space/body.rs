//! A body in a curved space: head, eyes and hands of somebody who moves in a flat room.
//!
//! A headset tells where head, eyes and hands are in a room, in metres. A curved space has no room in it, so something has
//! to be given up; what, is the choice of a [`Tracking`]. The problem, and the demand that a body stays coherent, are Weeks'
//! (*Body coherence in curved-space virtual reality games*, arXiv 2011.00510): because of holonomy, a head and two hands that
//! are each moved through the space on their own would after a while no longer be where the player feels them.
//!
//! **One frame for the whole body.** Here the head alone is moved through the space. It carries a frame whose axes are those
//! of the room, the *body frame*, and everything else hangs off it: an eye or a hand that is at offset `v` from the head in
//! the room is at the end of the geodesic that leaves the head with velocity `v`, and its own axes are those of the body frame,
//! carried there by parallel transport and turned as it is turned in the room. So what the player sees of his hands from where
//! his head is agrees with what he feels, in each mode and after each walk: distance and direction of each part from the head
//! are those of the room, to the last digit. What is not kept is the distance of one hand from the other (geodesics spread in
//! hyperbolic directions and close up in spherical ones, by a part in R²/6 at R units of length), and a hand that rests while
//! the head moves does not rest in the space.
//!
//! | mode | the head moves | kept | given up |
//! | --- | --- | --- | --- |
//! | [`Tracking::Holonomy`] | through the space, step by step, by parallel transport | a walk in the room is the same walk in the space: straight lines are geodesics, lengths and turns are true | a closed walk in the room does not lead back: the body frame comes back turned by the holonomy of the loop, so the room's walls and its "up" lose their place in the space |
//! | [`Tracking::Reference`] | to the end of the geodesic from a fixed frame that stands for the room's origin | each place in the room is one place in the space, with one body frame; closed walks close | only lines through the origin are geodesics; elsewhere steps are longer or shorter than in the room, by a part in R²/6, and in a sphere nobody gets farther than to the antipode |
//! | [`Tracking::RotationOnly`] | not at all | nothing ever comes too near | leaning has no effect: no parallax by the head's own motion |

use super::{domain::Domain, observer::Frame, reduce::TransportError};
use crate::geometry::{Geometry, GeometryId, Visitor, visit};
use glam::{DMat3, DQuat, DVec3};

/// How the motion of the head in the room becomes a motion in the space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tracking {
    /// Steps of the head are walked in the space.
    #[default]
    Holonomy,
    /// The head is reached from the frame that stands for the room's origin.
    Reference,
    /// The head only turns.
    RotationOnly,
}

impl Tracking {
    /// All modes with their names on the command line.
    pub const NAMES: &[(&'static str, Tracking)] =
        &[("holonomy", Self::Holonomy), ("reference", Self::Reference), ("rotation-only", Self::RotationOnly)];
}

/// Where something is in the room: metres, and a turn from the room's axes (right, up, back) to its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoomPose {
    /// Position in metres.
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
}

/// Nobody is farther from the room's origin, in metres: a pose that says so is wrong.
const LARGEST_ROOM: f64 = 100.0;

impl RoomPose {
    /// At the room's origin, unturned.
    pub const ORIGIN: Self = Self { position: DVec3::ZERO, rotation: DQuat::IDENTITY };

    /// Whether the position is finite and in a room of bearable size, and the rotation is one.
    pub fn is_sound(&self) -> bool {
        self.position.length() < LARGEST_ROOM
            && self.rotation.is_finite()
            && (self.rotation.length() - 1.0).abs() < 1e-2
    }
}

/// A body that stands in a space.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    geometry: GeometryId,
    tracking: Tracking,
    /// Metres in a unit of length.
    unit_in_metres: f64,
    /// Frame with the room's axes: at the head, or in the mode `reference` at what stands for the room's origin.
    anchor: Frame,
    /// From vectors of the runtime's room to those of ours, which was turned when it was recentred.
    turn: DQuat,
    /// Where our room's origin is in the runtime's room, in metres.
    origin: DVec3,
    /// Where the head was last, in our room.
    last: RoomPose,
}

impl Body {
    /// A body whose room's origin is at `start`, and whose head is there.
    pub fn new(geometry: GeometryId, start: Frame, tracking: Tracking, unit_in_metres: f64) -> Self {
        Self {
            geometry,
            tracking,
            unit_in_metres,
            anchor: start,
            turn: DQuat::IDENTITY,
            origin: DVec3::ZERO,
            last: RoomPose::ORIGIN,
        }
    }

    /// Metres in a unit of length.
    pub fn unit_in_metres(&self) -> f64 {
        self.unit_in_metres
    }

    /// A pose of the runtime's room in ours.
    fn in_room(&self, pose: RoomPose) -> RoomPose {
        RoomPose {
            position: self.turn * (pose.position - self.origin),
            rotation: (self.turn * pose.rotation).normalize(),
        }
    }

    /// Takes the head to where it is in the runtime's room now.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn track(&mut self, domain: &Domain, head: RoomPose) -> Result<(), TransportError> {
        let head = self.in_room(head);
        if self.tracking == Tracking::Holonomy {
            let step = (head.position - self.last.position) / self.unit_in_metres;
            self.anchor = walked(self.geometry, domain, self.anchor, step)?;
        }
        self.last = head;
        Ok(())
    }

    /// The body frame: at the head, with the room's axes.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn frame(&self, domain: &Domain) -> Result<Frame, TransportError> {
        match self.tracking {
            Tracking::Holonomy | Tracking::RotationOnly => Ok(self.anchor),
            Tracking::Reference => walked(self.geometry, domain, self.anchor, self.last.position / self.unit_in_metres),
        }
    }

    /// The head's own frame: axes right, up and back.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn head(&self, domain: &Domain) -> Result<Frame, TransportError> {
        Ok(self.frame(domain)?.rotated(DMat3::from_quat(self.last.rotation)))
    }

    /// The frame of an eye or a hand that is at `pose` in the runtime's room, hung off the body frame.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn place(&self, domain: &Domain, pose: RoomPose) -> Result<Frame, TransportError> {
        let pose = self.in_room(pose);
        let offset = (pose.position - self.last.position) / self.unit_in_metres;
        let reached = walked(self.geometry, domain, self.frame(domain)?, offset)?;
        Ok(reached.rotated(DMat3::from_quat(pose.rotation)))
    }

    /// Walks along the geodesic that leaves the head in a direction of the runtime's room, by so many metres: the room
    /// goes along.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn walk(&mut self, domain: &Domain, step: DVec3) -> Result<(), TransportError> {
        let step = self.turn * step / self.unit_in_metres;
        match self.tracking {
            Tracking::Holonomy | Tracking::RotationOnly => {
                self.anchor = walked(self.geometry, domain, self.anchor, step)?;
            }
            Tracking::Reference => {
                // The head walks, and what stands for the origin is where one comes from there by the way back.
                let head = walked(self.geometry, domain, self.frame(domain)?, step)?;
                self.anchor = walked(self.geometry, domain, head, -self.last.position / self.unit_in_metres)?;
            }
        }
        Ok(())
    }

    /// Turns the body about the room's vertical through the head, to the left for positive angles in radians.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn turn_left(&mut self, domain: &Domain, angle: f64) -> Result<(), TransportError> {
        let by = DMat3::from_quat(DQuat::from_rotation_y(angle));
        match self.tracking {
            Tracking::Holonomy | Tracking::RotationOnly => self.anchor = self.anchor.rotated(by),
            Tracking::Reference => {
                let head = self.frame(domain)?.rotated(by);
                self.anchor = walked(self.geometry, domain, head, -self.last.position / self.unit_in_metres)?;
            }
        }
        Ok(())
    }

    /// Puts the head, which is at `head` in the runtime's room, to `place` and looking along the frame's third axis backwards;
    /// the room's vertical stays vertical.
    pub fn recentre(&mut self, head: RoomPose, place: Frame) {
        let back = head.rotation * DVec3::Z;
        let heading = back.x.atan2(back.z);
        // Looking straight up or down has no heading: then the room is not turned.
        self.turn = if back.x.hypot(back.z) > 1e-3 { DQuat::from_rotation_y(-heading) } else { DQuat::IDENTITY };
        self.origin = head.position;
        self.anchor = place;
        self.last = self.in_room(head);
    }
}

/// The frame after a walk, in whatever geometry.
fn walked(id: GeometryId, domain: &Domain, frame: Frame, step: DVec3) -> Result<Frame, TransportError> {
    struct Walk<'a>(&'a Domain, Frame, DVec3);
    impl Visitor for Walk<'_> {
        type Output = Result<Frame, TransportError>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            self.1.walked(geometry, self.0, self.2)
        }
    }
    visit(id, Walk(domain, frame, step))
}
