//! What an eye of a headset saw, as a file: enough to draw it again without a headset.

use super::Failure;
use crate::{
    render::{Shot, world::Pose},
    scene::{Scene, avatar},
    space::{body::RoomPose, observer::Frame},
    view::xr::frames::Look,
};
use anyhow::{Context, anyhow};
use glam::DVec4;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::{fs, path::Path};

/// A frame: cell, point and axes in the geometry's coordinates, padded to four.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct FrameText {
    cell: usize,
    point: [f64; 4],
    axes: [[f64; 4]; 3],
}

impl From<Frame> for FrameText {
    fn from(frame: Frame) -> Self {
        Self { cell: frame.cell, point: frame.point.to_array(), axes: frame.axes.map(|axis| axis.to_array()) }
    }
}

impl FrameText {
    fn frame(&self, scene: &Scene) -> Result<Frame, anyhow::Error> {
        let frame = Frame { cell: self.cell, point: DVec4::from(self.point), axes: self.axes.map(DVec4::from) };
        let finite = frame.point.is_finite() && frame.axes.iter().all(|axis| axis.is_finite());
        if !finite || frame.cell >= scene.space.cells.len() {
            return Err(anyhow!("the frame in cell {} is not one of {}", frame.cell, scene.space.name));
        }
        Ok(frame)
    }
}

/// What an eye saw.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct EyeFile {
    eye: FrameText,
    /// Left, right, down, up.
    tangents: [f64; 4],
    size: [u32; 2],
    bounces: u32,
    observer: FrameText,
    hands: [Option<FrameText>; 2],
    time: f64,
    unit_in_metres: f64,
    bare: bool,
    /// What the runtime said, for those who read it.
    #[serde(default)]
    room: Value,
}

impl EyeFile {
    pub fn new(shot: &Shot, pose: &Pose, bounces: u32, unit_in_metres: f64, bare: bool) -> Self {
        Self {
            eye: shot.eye.into(),
            tangents: shot.tangents,
            size: shot.size,
            bounces,
            observer: pose.observer.into(),
            hands: pose.hands.map(|hand| hand.map(FrameText::from)),
            time: pose.time,
            unit_in_metres,
            bare,
            room: Value::Null,
        }
    }

    /// The file's text, with what the runtime said of this eye.
    pub fn to_text(&self, look: &Look, eye: usize) -> Result<String, Failure> {
        let pose =
            |pose: &RoomPose| json!({ "position": pose.position.to_array(), "rotation": pose.rotation.to_array() });
        let room = json!({
            "eye": pose(&look.eyes[eye].pose),
            "angles": look.eyes[eye].angles,
            "head": pose(&look.head),
            "grips": look.hands.map(|hand| hand.grip.as_ref().map(pose)),
            "aims": look.hands.map(|hand| hand.aim.as_ref().map(pose)),
            "forward": look.buttons.forward,
            "stick": look.buttons.stick,
            "recentre": look.buttons.recentre,
        });
        serde_json::to_string_pretty(&Self { room, ..self.clone() }).map_err(Failure::failed)
    }

    /// Reads a file, and takes the scene to where it was.
    ///
    /// # Errors
    /// The file is not there, is none of these, or belongs to another space.
    pub fn read(path: &Path, scene: &mut Scene) -> Result<(Self, Pose), Failure> {
        let shown = path.display().to_string();
        let mut read = || -> anyhow::Result<(Self, Pose)> {
            let file: Self = serde_json::from_slice(&fs::read(path)?)?;
            let [left, right, down, up] = file.tangents;
            let sound = file.tangents.iter().all(|t| t.abs() < 1e3) && left < right && down < up;
            if !sound || file.size.iter().any(|side| !(1..=super::MAX_SIDE).contains(side)) {
                return Err(anyhow!("the frustum or the size is none"));
            }
            if !(file.unit_in_metres > 0.0 && file.time.is_finite()) {
                return Err(anyhow!("the unit or the time is none"));
            }
            let mut hands = [None; 2];
            for (hand, text) in hands.iter_mut().zip(&file.hands) {
                *hand = text.as_ref().map(|text| text.frame(scene)).transpose()?;
            }
            file.eye.frame(scene)?;
            let pose = Pose { observer: file.observer.frame(scene)?, time: file.time, hands };
            if !file.bare {
                avatar::add(scene, file.unit_in_metres)?;
            }
            scene.settings.bounces = file.bounces.clamp(1, crate::scene::MAX_BOUNCES);
            scene.observer.frame = pose.observer;
            Ok((file, pose))
        };
        read().with_context(|| shown).map_err(Failure::Refused)
    }

    /// The picture to take.
    pub fn shot(&self) -> Shot {
        Shot {
            eye: Frame {
                cell: self.eye.cell,
                point: DVec4::from(self.eye.point),
                axes: self.eye.axes.map(DVec4::from),
            },
            tangents: self.tangents,
            size: self.size,
            samples: 1,
            seed: 0,
            bounces: None,
        }
    }
}
