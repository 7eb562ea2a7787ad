//! The `[[observer.path]]` tables of a scene file: key poses of a camera path.

use super::{
    places::{self, Local},
    reader::{Bounds, SceneError, Table},
};
use crate::{
    geometry::{Geometry, Visitor, visit},
    space::{
        Space,
        domain::Domain,
        observer::{Frame, Leg},
        reduce::TransportError,
    },
};
use glam::{DMat3, DQuat, DVec3};

pub(super) const KEYS: &[&str] = &["step", "rotate", "position", "cell", "look", "up", "frames"];

/// Most pictures between two keys, and largest distance.
const MAX_FRAMES: u32 = 1_000_000;
const MAX_STEP: f64 = 1000.0;

/// The ways between the key poses of a path that starts at `start`.
pub(super) fn read(tables: Vec<Table>, space: &Space, start: Frame) -> Result<Vec<Leg>, SceneError> {
    let mut from = start;
    let mut legs = Vec::with_capacity(tables.len());
    for mut table in tables {
        let frames = table.take("frames").map_or(Ok(48), |value| value.integer(1, MAX_FRAMES))?;
        let absolute = table.has("position");
        let leg = if absolute {
            let local = Local::read(&mut table, space)?;
            let look = table.take("look").map_or(Ok(DVec3::NEG_Z), |value| local.direction(&value))?;
            let target = local.frame(local.upright(-look, table.take("up").as_ref())?);
            if target.cell != from.cell {
                let message = format!(
                    "the key pose is in cell {}, the one before it in cell {}: use \"step\" to walk from cell to cell",
                    target.cell, from.cell
                );
                return Err(table.error(message));
            }
            let (step, turn) = visit(space.geometry, Way(from, target));
            Leg { step, turn, frames }
        } else {
            let bounds = Bounds::closed(-MAX_STEP, MAX_STEP);
            let step = table.take("step").map_or(Ok(vec![0.0; 3]), |value| value.numbers(&[3], bounds))?;
            let turn = table.take("rotate").map_or(Ok(DMat3::IDENTITY), |value| places::turns(&value))?;
            Leg { step: DVec3::new(step[0], step[1], step[2]), turn: rotation_vector(turn), frames }
        };
        from = visit(space.geometry, Arrive(space, from, leg)).map_err(|error| table.error(error.to_string()))?;
        table.finish(if absolute {
            "in a key pose with \"position\""
        } else {
            "in a key pose without \"position\""
        })?;
        legs.push(leg);
    }
    Ok(legs)
}

fn rotation_vector(rotation: DMat3) -> DVec3 {
    DQuat::from_mat3(&rotation).to_scaled_axis()
}

/// The shortest geodesic from one pose to another, in coordinates of their cell, and the turn on it.
struct Way(Frame, Frame);

impl Visitor for Way {
    type Output = (DVec3, DVec3);
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let Self(from, to) = self;
        let components =
            |frame: &Frame, v| DVec3::from_array(frame.axes.map(|axis| geometry.inner(frame.point, axis, v)));
        let (direction, length) = geometry.log(from.point, to.point);
        let step = components(&from, direction) * length;
        let carried = Frame { point: to.point, ..from.moved(geometry, step) };
        let [x, y, z] = to.axes.map(|axis| components(&carried, axis));
        (step, rotation_vector(DMat3::from_cols(x, y, z)))
    }
}

struct Arrive<'a>(&'a Space, Frame, Leg);

impl Visitor for Arrive<'_> {
    type Output = Result<Frame, TransportError>;
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let Self(space, from, leg) = self;
        leg.pose(geometry, &Domain::new(space), from, 1.0)
    }
}
