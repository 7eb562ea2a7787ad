//! Balls, tubes and the edges of cells: quadrics where the geometry has them, triangles elsewhere.

use super::{
    WorldError, WorldQuadric,
    build::Builder,
    meshes::{RestMesh, RestTriangle},
    place::{Balls, Copy, copies, keeps_to_chart},
    tessellate::{self, Surface},
};
use crate::{
    geometry::{Geodesic, Geometry, Quadric, exponential},
    render::bvh::Aabb,
    scene::Object,
    space::{observer::Frame, polyhedron::Polyhedron},
};
use glam::{DVec3, DVec4};

impl<G: Geometry> Builder<'_, G> {
    /// A metric ball.
    pub(super) fn add_ball(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        centre: DVec4,
        radius: f64,
    ) -> Result<Vec<Copy>, WorldError> {
        let geometry = self.geometry;
        if geometry.ball(centre, radius).is_none() {
            return self.add_surface(index, object, cell, tessellate::ball(geometry, centre, radius), radius);
        }
        if !keeps_to_chart(geometry, radius) {
            return Err(WorldError::TooWide(object.name.clone(), radius));
        }
        let extent = Balls { centres: &[centre], radius };
        let copies = copies(geometry, &self.domain, cell, &extent, &object.name)?;
        for copy in &copies {
            let image = geometry.apply(&copy.isometry, Geodesic { point: centre, velocity: DVec4::ZERO }).point;
            if let Some(ball) = geometry.ball(image, radius)
                && let Some(quadric) = self.add_quadric(index, object, copy, ball, [DVec4::W; 2], ball_box(&ball))
            {
                self.solids.balls.push(Ball { quadric, centre: geometry.chart(image), radius });
            }
        }
        Ok(copies)
    }

    /// A tube around a piece of geodesic, with balls at its ends.
    pub(super) fn add_tube(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        axis: Geodesic,
        length: f64,
        radius: f64,
    ) -> Result<(), WorldError> {
        let geometry = self.geometry;
        match geometry.tube(axis, radius) {
            Some(_) => self.add_quadric_tube(index, object, cell, axis, length, radius)?,
            None => {
                let surface = tessellate::tube(geometry, |t| geometry.flow(axis, t * length), radius);
                self.add_surface(index, object, cell, surface, radius)?;
            }
        }
        for end in [axis.point, geometry.flow(axis, length).point] {
            self.add_ball(index, object, cell, end, radius)?;
        }
        Ok(())
    }

    /// A tube around a straight line of the chart, open at its ends.
    pub(super) fn add_line(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        ends: [DVec3; 2],
        radius: f64,
    ) -> Result<(), WorldError> {
        let geometry = self.geometry;
        let [Some(a), Some(b)] = ends.map(|c| geometry.unchart(c)) else {
            return Err(WorldError::OutsideChart(object.name.clone()));
        };
        let (velocity, length) = geometry.log(a, b);
        let axis = Geodesic { point: a, velocity };
        if G::STRAIGHT && geometry.tube(axis, radius).is_some() {
            return self.add_quadric_tube(index, object, cell, axis, length, radius);
        }
        let surface = tessellate::tube(geometry, |t| chart_line(geometry, ends, t), radius);
        self.add_surface(index, object, cell, surface, radius).map(|_| ())
    }

    /// Tubes around the edges of a cell, and balls at its vertices.
    pub(super) fn add_edges(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        radius: f64,
    ) -> Result<(), WorldError> {
        let geometry = self.geometry;
        let Some(polyhedron) = self.polyhedra[cell].clone() else {
            return Err(WorldError::NoEdges(object.name.clone()));
        };
        let vertices: Vec<DVec4> = polyhedron.vertices.iter().filter_map(|c| geometry.unchart(*c)).collect();
        if vertices.len() != polyhedron.vertices.len() {
            return Err(WorldError::OutsideChart(object.name.clone()));
        }
        // Edges that are copies of one another under the pairings are made once; likewise vertices.
        let mut made = Made::default();
        for edge in &polyhedron.edges {
            let ends = edge.vertices.map(|v| polyhedron.vertices[v]);
            let [a, b] = edge.vertices.map(|v| vertices[v]);
            let (velocity, length) = geometry.log(a, b);
            let axis = Geodesic { point: a, velocity };
            if G::STRAIGHT && geometry.tube(axis, radius).is_some() {
                self.add_quadric_tube(index, object, cell, axis, length, radius)?;
            } else if !made.has(cell, &ends) {
                let surface = tessellate::tube(geometry, |t| chart_line(geometry, ends, t), radius);
                made.add(geometry, &self.add_surface(index, object, cell, surface, radius)?, &[a, b]);
            }
        }
        for (centre, place) in vertices.iter().zip(&polyhedron.vertices) {
            if !made.has(cell, &[*place]) {
                made.add(geometry, &self.add_ball(index, object, cell, *centre, radius)?, &[*centre]);
            }
        }
        Ok(())
    }

    fn add_quadric_tube(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        axis: Geodesic,
        length: f64,
        radius: f64,
    ) -> Result<(), WorldError> {
        let geometry = self.geometry;
        // A tube lies inside the union of balls along its axis, with half of their spacing added to the radius.
        const BALLS: usize = 48;
        let spacing = length / BALLS as f64;
        let along: Vec<DVec4> = (0..=BALLS).map(|i| geometry.flow(axis, spacing * i as f64).point).collect();
        let wide = radius + 0.5 * spacing;
        let extent = Balls { centres: &along, radius: wide };
        for copy in copies(geometry, &self.domain, cell, &extent, &object.name)? {
            let start = geometry.apply(&copy.isometry, axis);
            let end = geometry.flow(start, length);
            let clip = |g: Geodesic, sign: f64| {
                let conormal = geometry.lower(g.point, g.velocity) * sign;
                conormal.extend(-conormal.dot(geometry.chart(g.point)))
            };
            // Only the part inside the cell is met there.
            let inside: Vec<usize> = extent.inside(geometry, &self.domain, &copy).collect();
            let (Some(first), Some(last)) = (inside.first(), inside.last()) else { continue };
            let at = |i: f64| geometry.flow(start, spacing * i);
            let bounds = (*first..=*last)
                .filter_map(|i| geometry.ball(at(i as f64).point, wide))
                .map(|ball| ball_box(&ball))
                .fold(Aabb::EMPTY, Aabb::union);
            let bounds = if bounds.lower.is_finite() && bounds.upper.is_finite() {
                let (from, to) = ((*first as f64 - 0.5).max(0.0), (*last as f64 + 0.5).min(BALLS as f64));
                tube_box(geometry, at(from), spacing * (to - from), radius).intersection(bounds)
            } else {
                bounds
            };
            let clips = [clip(start, 1.0), clip(end, -1.0)];
            if let Some(tube) = geometry.tube(start, radius)
                && self.add_quadric(index, object, &copy, tube, clips, bounds).is_some()
            {
                let ends = [start, end].map(|g| geometry.chart(g.point));
                self.solids.tubes.push(Tube { cell: copy.cell, ends, length, radius });
            }
        }
        Ok(())
    }

    /// Adds a quadric to a cell unless the same surface is there already: edges of a cell are copies of one another, and
    /// where surfaces of two objects coincide the first is seen, whichever way a backend looks for hits. Its index, if it
    /// was added.
    fn add_quadric(
        &mut self,
        index: usize,
        object: &Object,
        copy: &Copy,
        surface: Quadric,
        clip: [DVec4; 2],
        bounds: Aabb,
    ) -> Option<usize> {
        // Quadrics have a material of their own: the scene reader refuses them without.
        let material = object.material.unwrap_or(0) as u32;
        let same = |a: DVec4, b: DVec4| (a - b).abs().max_element() < 1e-9;
        // Frames that name the same surface may be turned against each other, so its matrix is compared.
        let form = surface.matrix();
        let is_known = self.quadrics.iter().any(|known| {
            known.cell == copy.cell
                && (0..4).all(|i| same(known.surface.matrix().col(i), form.col(i)))
                && (same(known.clip[0], clip[0]) && same(known.clip[1], clip[1])
                    || same(known.clip[0], clip[1]) && same(known.clip[1], clip[0]))
        });
        let bounds = match &self.polyhedra[copy.cell] {
            Some(polyhedron) => bounds.intersection(Aabb::around(polyhedron.vertices.iter().copied())),
            None => bounds,
        };
        // What only touches the cell with its end is seen in the cell where it goes on.
        const THIN: f64 = 1e-12;
        if is_known || (bounds.upper - bounds.lower).min_element() < THIN {
            return None;
        }
        let object = index as u32;
        self.quadrics.push(WorldQuadric { surface, clip, bounds, cell: copy.cell, material, object });
        Some(self.quadrics.len() - 1)
    }

    /// Leaves out balls that are inside of tubes as far as the cell goes: those at a vertex, where tubes that are no thinner
    /// begin along all of its edges, as in a drawing of all edges.
    ///
    /// A point p of the cell, seen from its vertex, is a sum of vectors along the edges there with weights that are not
    /// negative, since cells are convex. With one of them, e, its product is positive, as p · p is: p is on that side of the
    /// plane where the tube along e begins. And the tube's axis is no farther from p than the vertex, which is on it. So a
    /// ball is inside of the tubes, in the three geometries whose balls and tubes are quadrics.
    pub(super) fn drop_hidden_balls(&mut self) {
        let mut seen = vec![true; self.quadrics.len()];
        for ball in &self.solids.balls {
            let cell = self.quadrics[ball.quadric].cell;
            seen[ball.quadric] = !self.polyhedra[cell].as_ref().is_some_and(|p| self.solids.hide(ball, cell, p));
        }
        let mut seen = seen.into_iter();
        self.quadrics.retain(|_| seen.next().unwrap_or(true));
        self.solids = Solids::default();
    }

    /// Adds a ball or a tube that was divided into triangles, if it could be.
    fn add_surface(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        surface: Option<Surface>,
        radius: f64,
    ) -> Result<Vec<Copy>, WorldError> {
        let surface = surface.ok_or_else(|| WorldError::TooWide(object.name.clone(), radius))?;
        let material = object.material.unwrap_or(0) as u32;
        let corners = surface.triangles.into_iter();
        let triangles = corners.map(|corners| RestTriangle { corners, uv: [[0.0; 2]; 3], material }).collect();
        let frame = Frame { cell, point: self.geometry.base(), axes: self.geometry.frame(self.geometry.base()) };
        let rest = RestMesh::in_chart(self.geometry, index as u32, frame, surface.placed, triangles);
        self.add_divided(object, rest)
    }
}

/// Balls and tubes that quadrics stand for.
#[derive(Default)]
pub(super) struct Solids {
    balls: Vec<Ball>,
    tubes: Vec<Tube>,
}

/// A ball.
struct Ball {
    /// Index of its quadric.
    quadric: usize,
    /// In the chart of its cell.
    centre: DVec3,
    radius: f64,
}

/// A tube in a cell.
struct Tube {
    cell: usize,
    /// Ends of its axis, in the chart of the cell.
    ends: [DVec3; 2],
    /// Geodesic length of the axis.
    length: f64,
    radius: f64,
}

impl Solids {
    /// Whether tubes along all edges at a vertex of the cell hide a ball there.
    fn hide(&self, ball: &Ball, cell: usize, polyhedron: &Polyhedron) -> bool {
        let Some(vertex) = polyhedron.vertices.iter().position(|v| same(*v, ball.centre)) else { return false };
        let tubes: Vec<DVec3> = self.tubes.iter().filter(|t| t.cell == cell).filter_map(|t| t.covering(ball)).collect();
        // Geodesics are straight in the chart.
        let beside = |along: DVec3| tubes.iter().any(|tube| same(tube.normalize(), along.normalize()));
        polyhedron.edges.iter().all(|edge| match edge.vertices {
            [v, other] | [other, v] if v == vertex => beside(polyhedron.vertices[other] - polyhedron.vertices[v]),
            _ => true,
        })
    }
}

impl Tube {
    /// The direction in which it begins at the centre of a ball that is no wider than it is wide and long.
    fn covering(&self, ball: &Ball) -> Option<DVec3> {
        let [a, b] = self.ends;
        let far = if same(a, ball.centre) { Some(b) } else { same(b, ball.centre).then_some(a) };
        let wide = self.radius >= ball.radius * (1.0 - SAME) && self.length >= ball.radius;
        far.filter(|_| wide).map(|far| far - ball.centre)
    }
}

/// Points and unit vectors that are as near to each other are the same.
const SAME: f64 = 1e-9;

fn same(a: DVec3, b: DVec3) -> bool {
    a.distance(b) < SAME
}

/// The lines of a grid, along x, then y, then z.
pub(super) fn grid_lines(lower: DVec3, upper: DVec3, lines: [u32; 3]) -> Vec<[DVec3; 2]> {
    let place = |axis: usize, i: u32| {
        let share = if lines[axis] == 1 { 0.5 } else { f64::from(i) / f64::from(lines[axis] - 1) };
        lower[axis] + (upper[axis] - lower[axis]) * share
    };
    let mut all = Vec::new();
    for along in (0..3).filter(|&along| lower[along] < upper[along]) {
        let [first, second] = [(along + 1) % 3, (along + 2) % 3];
        for i in 0..lines[first] {
            for j in 0..lines[second] {
                let end = |corner: DVec3| {
                    let mut end = corner;
                    end[first] = place(first, i);
                    end[second] = place(second, j);
                    end
                };
                all.push([end(lower), end(upper)]);
            }
        }
    }
    all
}

/// A point of the straight line of the chart between two of its points, with the unit tangent.
fn chart_line<G: Geometry>(geometry: G, [from, to]: [DVec3; 2], t: f64) -> Geodesic {
    // The ends are points of the geometry, and cells are convex.
    let point = geometry.unchart(from.lerp(to, t)).unwrap_or(DVec4::NAN);
    let along = geometry.unchart_vector(point, to - from);
    Geodesic { point, velocity: along / geometry.norm(point, along) }
}

/// Images of edges and vertices that are there already, by cell and chart coordinates.
#[derive(Default)]
struct Made(Vec<(usize, Vec<DVec3>)>);

impl Made {
    fn has(&self, cell: usize, ends: &[DVec3]) -> bool {
        let near = |a: &DVec3, b: &DVec3| a.distance(*b) < 1e-6 * (1.0 + a.length());
        self.0.iter().any(|(in_cell, known)| {
            let same = |ends: &mut dyn Iterator<Item = &DVec3>| ends.zip(known).all(|(a, b)| near(a, b));
            *in_cell == cell && known.len() == ends.len() && (same(&mut ends.iter()) || same(&mut ends.iter().rev()))
        })
    }

    fn add<G: Geometry>(&mut self, geometry: G, copies: &[Copy], ends: &[DVec4]) {
        for copy in copies {
            let image = |&point: &DVec4| {
                geometry.chart(geometry.apply(&copy.isometry, Geodesic { point, velocity: DVec4::ZERO }).point)
            };
            self.0.push((copy.cell, ends.iter().map(image).collect()));
        }
    }
}

/// The box of a tube that is cut off across its ends: that of circles about its axis.
fn tube_box<G: Geometry>(geometry: G, axis: Geodesic, length: f64, radius: f64) -> Aabb {
    const CIRCLES: usize = 48;
    const POINTS: usize = 16;
    let circle = |i: usize| {
        let Geodesic { point, velocity } = geometry.flow(axis, length * i as f64 / CIRCLES as f64);
        // The two axes of the frame that lead away from the tube's own, made orthonormal to it and each other.
        let mut frame = geometry.frame(point);
        frame.sort_by(|a, b| {
            let along = |v: &DVec4| geometry.inner(point, *v, velocity).abs();
            along(a).total_cmp(&along(b))
        });
        let across = |v: DVec4, other: DVec4| {
            let v = v - velocity * geometry.inner(point, v, velocity) - other * geometry.inner(point, v, other);
            v / geometry.norm(point, v)
        };
        let one = across(frame[0], DVec4::ZERO);
        let other = across(frame[1], one);
        let points: Vec<DVec3> = (0..POINTS)
            .map(|k| {
                let (sin, cos) = (k as f64 * std::f64::consts::TAU / POINTS as f64).sin_cos();
                geometry.chart(exponential(geometry, point, (one * cos + other * sin) * radius))
            })
            .collect();
        let around = Aabb::around(points.iter().copied());
        let margin = bulge((0..POINTS).map(|k| [k, k + 1, k + 2].map(|k| points[k % POINTS])));
        Aabb { lower: around.lower - margin, upper: around.upper + margin }
    };
    let circles: Vec<Aabb> = (0..=CIRCLES).map(circle).collect();
    let bounds = circles.iter().fold(Aabb::EMPTY, |b, circle| b.union(*circle));
    let lower = bulge(circles.windows(3).map(|c| [c[0].lower, c[1].lower, c[2].lower]));
    let upper = bulge(circles.windows(3).map(|c| [c[0].upper, c[1].upper, c[2].upper]));
    Aabb { lower: bounds.lower - lower, upper: bounds.upper + upper }
}

/// How far a curve may reach beyond points of it, from all threes of neighbours: an eighth of their second difference, and a
/// third more because that is not the same everywhere.
fn bulge(neighbours: impl Iterator<Item = [DVec3; 3]>) -> DVec3 {
    neighbours.fold(DVec3::ZERO, |most, [a, b, c]| most.max((a - 2.0 * b + c).abs())) / 6.0
}

/// The box of an ellipsoid in the chart: its tangent planes are the zeros of the inverse matrix.
pub(super) fn ball_box(ball: &Quadric) -> Aabb {
    let dual = ball.dual();
    let mut bounds = Aabb::EVERYTHING;
    for axis in 0..3 {
        // Planes x_axis = s: dual_aa − 2 s dual_aw + s² dual_ww = 0.
        let (aa, aw, ww) = (dual.col(axis)[axis], dual.col(3)[axis], dual.col(3)[3]);
        let root = (aw * aw - aa * ww).max(0.0).sqrt();
        let ends = [(aw + root) / ww, (aw - root) / ww];
        // An unbounded quadric (a ball that reaches the horizon) keeps the infinite box.
        if ww < 0.0 && ends.iter().all(|e| e.is_finite()) {
            bounds.lower[axis] = ends[0].min(ends[1]);
            bounds.upper[axis] = ends[0].max(ends[1]);
        }
    }
    bounds
}
