//! Model geometries behind one contract.
//!
//! A geometry is a homogeneous Riemannian (or, for one of the book's spaces, Lorentzian) three-manifold with
//! an explicit flow. Everything that the renderer, the spaces and the measurements know about it is the trait
//! [`Geometry`], and its GLSL twin in `shaders/geometry/`, function by function under the same names with the
//! prefix `geo_`. A new geometry is those two files and one line in the registry, `registry.rs`.
//!
//! **Points and tangent vectors** are four numbers whose meaning is the geometry's own (`mathematics` in the
//! module of each geometry): ambient coordinates in R⁴ for the classical three.
//!
//! **The chart** maps the model (or the part of it in which a cell lies) to R³. Meshes are stored in it and
//! acceleration structures are built in it. Face planes are affine there: a plane is `(n, d)` and its inner
//! side is `n·c + d ≤ 0` for chart coordinates `c`.
//!
//! **The curve parameter.** A ray does not walk by arc length but by a parameter of the geometry's own choice,
//! in which exits are cheap (`tan(t/2)` on the sphere, `tanh t` in hyperbolic space, arc length where nothing
//! better exists). It is 0 at the start, increases with arc length, and [`Geometry::length`] and
//! [`Geometry::parameter_at`] convert.
//!
//! **Arcs.** Where geodesics are straight in the chart, the way to the next face is one straight segment for
//! traversal. Elsewhere segments are arcs of parabolas that share with the curve both ends and the
//! change of its velocity. [`Geometry::arc`] says how far along the curve one may reach before it leaves the curve by more
//! than a tolerance: the deviation falls with the third power of the length, that of a straight chord with the second.

mod curved;
pub mod e3;
pub mod h2xr;
pub mod h3;
pub mod laws;
pub mod nil;
mod passage;
pub mod product;
pub mod real;
pub(crate) mod registry;
pub mod s2xr;
pub mod s3;
pub mod sl2;
pub mod sl2_trace;
pub mod sol;

pub use real::{Elementary, Real, Real2, Real3, Real4, RealGeodesic};

use glam::{DAffine3, DMat4, DVec3, DVec4, Vec4Swizzles};
use registry::geometries;

/// A point with a tangent vector there; a unit vector unless said otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodesic {
    /// The point, in the geometry's own coordinates.
    pub point: DVec4,
    /// The velocity at the point, in the geometry's own components.
    pub velocity: DVec4,
}

/// An isometry. What the numbers mean is the geometry's own business; `linear` alone serves those whose
/// isometries are linear in the point's coordinates, `shift` is for the rest (a shift along a line factor, say).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isometry {
    /// Acts on columns.
    pub linear: DMat4,
    /// Zero where the linear part says all.
    pub shift: DVec4,
}

impl Isometry {
    /// The identity.
    pub const IDENTITY: Self = Self { linear: DMat4::IDENTITY, shift: DVec4::ZERO };

    /// An isometry that is linear in the point's coordinates.
    pub const fn linear(linear: DMat4) -> Self {
        Self { linear, shift: DVec4::ZERO }
    }
}

/// The surface `xᵀQx = 0` with `x = (c, 1)`, `c` in the chart, and inside negative: a sum of squares of linear forms
/// minus a small multiple of the metric's own form, `Σ (Lᵢ·x)² − (quadratic |c|² + constant)`.
///
/// A thin tube is a small difference of large numbers in the entries of `Q`; here its radius stands alone, and the
/// discriminant of a ray needs no cancellation (`shaders/stage/quadric.glsl`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quadric {
    /// The linear forms `Lᵢ`: the distances from mutually normal planes through the centre or the axis.
    pub forms: [DVec4; 3],
    /// Coefficient of `|c|²`.
    pub quadratic: f64,
    /// The rest.
    pub constant: f64,
}

impl Quadric {
    /// The symmetric matrix `Q`.
    pub fn matrix(&self) -> DMat4 {
        let k = -self.quadratic;
        let rest = DMat4::from_diagonal(DVec4::new(k, k, k, -self.constant));
        self.forms.iter().fold(rest, |sum, l| sum + DMat4::from_cols(*l * l.x, *l * l.y, *l * l.z, *l * l.w))
    }

    /// The inverse of the matrix, on which planes lie that touch the surface. By elimination with pivots: far from the
    /// origin of a hyperbolic chart the condition of `Q` grows with the fourth power of cosh d, and cofactors, which
    /// `DMat4::inverse` takes, have no digits left at d = 6.
    pub fn dual(&self) -> DMat4 {
        let mut rows = self.matrix().to_cols_array_2d();
        let mut inverse = DMat4::IDENTITY.to_cols_array_2d();
        for column in 0..4 {
            let largest = |a: &usize, b: &usize| rows[*a][column].abs().total_cmp(&rows[*b][column].abs());
            let pivot = (column..4).max_by(largest).unwrap_or(column);
            rows.swap(column, pivot);
            inverse.swap(column, pivot);
            for row in (0..4).filter(|row| *row != column) {
                let factor = rows[row][column] / rows[column][column];
                for k in 0..4 {
                    rows[row][k] -= factor * rows[column][k];
                    inverse[row][k] -= factor * inverse[column][k];
                }
            }
        }
        for (row, line) in inverse.iter_mut().enumerate() {
            line.iter_mut().for_each(|x| *x /= rows[row][row]);
        }
        // Rows were treated as columns, which is the same for a symmetric matrix.
        DMat4::from_cols_array_2d(&inverse).transpose()
    }

    /// Half of the gradient of `xᵀQx` in the chart.
    pub fn gradient(&self, c: DVec3) -> DVec3 {
        let squares: DVec3 = self.forms.iter().map(|l| l.truncate() * l.dot(c.extend(1.0))).sum();
        squares - c * self.quadratic
    }
}

/// What traversal gets of a path: `c(s) = origin + s direction + s (1 − s) bend` for s in [0, 1], in the chart. An arc of
/// a parabola, straight where `bend` is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The point at s = 0.
    pub origin: DVec3,
    /// From there to the point at s = 1.
    pub direction: DVec3,
    /// Four times the way from the middle of the chord to the middle of the arc.
    pub bend: DVec3,
}

impl Segment {
    /// The segment along `g` up to curve parameter `u`: its ends are the curve's, and so is the difference of its
    /// velocities there. (Where geodesics are curves in the chart, the curve parameter is that of the flow.)
    ///
    /// With |c‴| ≤ M along the curve it leaves it by at most M u³/96, the integral of the kernel of Peano for the
    /// third derivative, |(s−τ)₊² − s(1−τ)² + s(1−s)(1−τ)|/2, which is largest at s = ½.
    ///
    /// Returns the state at its end, too.
    #[inline]
    pub fn along<G: Geometry>(geometry: G, g: Geodesic, u: f64) -> (Self, Geodesic) {
        let end = geometry.advance(g, u);
        let origin = geometry.chart(g.point);
        let direction = geometry.chart(end.point) - origin;
        let bend = if G::STRAIGHT {
            DVec3::ZERO
        } else {
            let [before, after] = [g, end].map(|g| geometry.chart_vector(g.point, g.velocity));
            (before - after) * (0.5 * u)
        };
        (Self { origin, direction, bend }, end)
    }

    /// The point at `s`.
    pub fn at(&self, s: f64) -> DVec3 {
        self.origin + self.direction * s + self.bend * (s * (1.0 - s))
    }

    /// The derivative with respect to `s`.
    pub fn tangent(&self, s: f64) -> DVec3 {
        self.direction + self.bend * (1.0 - 2.0 * s)
    }

    /// The largest value that the form of a plane `(n, d)` may have on it: no less than at any of its points.
    pub fn highest(&self, plane: DVec4) -> f64 {
        let n = plane.truncate();
        let start = n.dot(self.origin) + plane.w;
        start.max(start + n.dot(self.direction)) + 0.25 * n.dot(self.bend).max(0.0)
    }

    /// The same parabola from `s = −before` to `s = 1 + after`, both small.
    pub fn extended(&self, before: f64, after: f64) -> Self {
        let (origin, end, whole) = (self.at(-before), self.at(1.0 + after), 1.0 + before + after);
        Self { origin, direction: end - origin, bend: self.bend * (whole * whole) }
    }
}

/// Why a computation has no answer that numbers can hold.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeometryError {
    /// The given point is not finite or not on the model.
    #[error("point {0} is not a point of {1}")]
    NotAPoint(String, &'static str),
    /// The tangent part of the given direction is zero or not finite.
    #[error("direction {0} has no tangent part at the point: it must be finite and not zero")]
    NoDirection(String),
    /// The geodesic leaves the chart.
    #[error("the geodesic of length {length} reaches {edge} of {geometry}")]
    Edge {
        /// The length asked for.
        length: f64,
        /// What it runs into.
        edge: &'static str,
        /// The geometry's name.
        geometry: &'static str,
    },
    /// The result does not fit into the numbers used.
    #[error("the end point after length {length} leaves the range of {precision} in {geometry}")]
    OutOfRange {
        /// The length asked for.
        length: f64,
        /// `f32` or `f64`.
        precision: &'static str,
        /// The geometry's name.
        geometry: &'static str,
    },
}

/// What the renderer, the spaces and the measurements may ask of a geometry.
///
/// All functions are pure. None panics on finite input; out-of-range results are infinities or `None`, which
/// callers turn into errors. The GLSL twin of `name` is `geo_name`, except for the functions marked *host only*.
pub trait Geometry: Copy + Send + Sync + 'static {
    /// Whether all geodesics are straight in the chart, so that a segment is the curve itself and no hit needs to be
    /// refined (twin: `GEO_STRAIGHT`). A geometry that does not say is taken for a curved one.
    const STRAIGHT: bool = false;

    // --- points and vectors -------------------------------------------------------------------------

    /// How many numbers the command line, scenes and reports use for a point or a vector: 3 or 4. *Host only.*
    fn components(&self) -> usize;

    /// How many numbers they use for a direction. *Host only.*
    fn direction_components(&self) -> usize {
        self.components()
    }

    /// The base point, at the origin of the chart: centre of Dirichlet domains, default position of observers.
    fn base(&self) -> DVec4;

    /// Puts a point given by the user on the model, or `None` if it has no place there. *Host only.*
    fn settle(&self, components: DVec4) -> Option<DVec4>;

    /// The tangent vector with these components at `p`: projected where components are ambient, and not
    /// normalised. *Host only.*
    fn settle_tangent(&self, p: DVec4, components: DVec4) -> DVec4;

    /// The metric.
    fn inner(&self, p: DVec4, u: DVec4, v: DVec4) -> f64;

    /// Length of a tangent vector, without the cancellation that `inner` suffers far from the base point. Where the
    /// metric is indefinite: the positive length in which [`frame`](Geometry::frame) is orthonormal. *Host only.*
    fn norm(&self, p: DVec4, v: DVec4) -> f64;

    /// An orthonormal frame at `p`, positively oriented in the chart, smooth in `p`. *Host only.*
    fn frame(&self, p: DVec4) -> [DVec4; 3];

    /// The metric in the frame, which is diagonal: ones, unless the metric is indefinite. Then velocities are not
    /// normalised, and lengths along geodesics are affine parameters. *Host only.*
    fn signature(&self) -> DVec3 {
        DVec3::ONE
    }

    // --- geodesics ----------------------------------------------------------------------------------

    /// The geodesic flow by arc length `t` (any sign), in f64. Exact up to rounding.
    #[inline]
    fn flow(&self, g: Geodesic, t: f64) -> Geodesic {
        self.flow_in(RealGeodesic::from_f64(g), t).to_f64()
    }

    /// The same in numbers of the precision `T`, and in none besides. *Host only:* the twin's is f32.
    fn flow_in<T: Elementary>(&self, g: RealGeodesic<T>, t: T) -> RealGeodesic<T>;

    /// What the geodesic `g` runs into within length `t` (any sign), where the chart does not hold all of it: its
    /// flow is infinite from there on. *Host only.*
    fn edge(&self, _g: Geodesic, _t: f64) -> Option<&'static str> {
        None
    }

    /// Unit initial velocity and length of the shortest geodesic from `p` to `q`. At `q = p` the length is 0
    /// and the velocity some unit vector; at a conjugate point the length is right and the velocity one of many.
    fn log(&self, p: DVec4, q: DVec4) -> (DVec4, f64);

    /// Distance of two points.
    fn distance(&self, p: DVec4, q: DVec4) -> f64 {
        self.log(p, q).1
    }

    /// A number that decreases with the distance of two points and costs no transcendental function: lights out of
    /// range are told by it. The same number everywhere (infinity, say) where a geometry has none.
    fn closeness(&self, p: DVec4, q: DVec4) -> f64;

    /// Parallel transport of `w` along `g` by arc length `t`. *Host only.*
    fn transport(&self, g: Geodesic, t: f64, w: DVec4) -> DVec4;

    /// Ratio of the area of a small wavefront after length `t` to its solid angle at the source: the reciprocal
    /// of the falloff of a point light. Depends on the ray where the geometry is not isotropic.
    fn area_density(&self, g: Geodesic, t: f64) -> f64;

    // --- rays: the curve parameter ------------------------------------------------------------------

    /// Segment length from the start of `g` to curve parameter `u`.
    fn length(&self, g: Geodesic, u: f64) -> f64;

    /// Curve parameter at arc length `t ≥ 0`; infinite where the parameter does not reach so far.
    fn parameter_at(&self, g: Geodesic, t: f64) -> f64;

    /// Point and velocity at curve parameter `u`.
    fn advance(&self, g: Geodesic, u: f64) -> Geodesic;

    /// Signed size of the plane's affine form at a point: negative inside, of order of the distance nearby.
    fn side(&self, p: DVec4, plane: DVec4) -> f64;

    /// First curve parameter `u ≥ 0` at which `g` passes from the inner side of `plane` to the outer one;
    /// infinite if it never does. A start on the plane (within [`ON_FACE`]) counts as inside, and a direction
    /// within [`ALONG_FACE`] of the plane does not leave through it. Passages beyond `reach` are not looked for: for
    /// them the result is any number greater than `reach`.
    fn exit(&self, g: Geodesic, plane: DVec4, reach: f64) -> f64;

    /// Largest curve parameter `≤ u_max` up to which the [`Segment`] stays within `tolerance` (a length
    /// in the metric) of the curve.
    fn arc(&self, g: Geodesic, u_max: f64, tolerance: f64) -> f64;

    /// Curve parameter of the curve's point nearest to chart point `c`, which lies on a segment of `g`.
    fn parameter(&self, g: Geodesic, c: DVec3) -> f64;

    /// Puts a state back on the model after rounding: point onto the constraint, velocity tangent and unit.
    fn restore(&self, g: Geodesic) -> Geodesic;

    // --- the chart ----------------------------------------------------------------------------------

    /// Chart coordinates of a point.
    fn chart(&self, p: DVec4) -> DVec3;

    /// The point with these chart coordinates, or `None` outside the chart's image. *Host only as an option;*
    /// the twin assumes a chart point of a cell.
    fn unchart(&self, c: DVec3) -> Option<DVec4>;

    /// The tangent vector at `p` whose image under the chart's differential is `dc`.
    fn unchart_vector(&self, p: DVec4, dc: DVec3) -> DVec4;

    /// The image of the tangent vector `v` at `p` under the chart's differential.
    fn chart_vector(&self, p: DVec4, v: DVec4) -> DVec3;

    /// The equation of geodesics in the chart: the second derivative `−Γ(v, v)` of the coordinates, by arc length, of
    /// the geodesic through the chart point `c` with chart velocity `v`. Quadratic in `v`.
    fn spray<T: Real>(&self, c: Real3<T>, v: Real3<T>) -> Real3<T>;

    /// Unit tangent vector at `p` that is normal to the surface with chart conormal `conormal` (a covector in
    /// the chart; it raises the index).
    fn raise(&self, p: DVec4, conormal: DVec3) -> DVec4;

    /// The chart covector of a tangent vector: inverse of `raise` up to length.
    fn lower(&self, p: DVec4, v: DVec4) -> DVec3;

    /// Volume element of the metric in the chart. *Host only.*
    fn volume_density(&self, c: DVec3) -> f64;

    // --- isometries ---------------------------------------------------------------------------------

    /// Image of a point and of a tangent vector there.
    fn apply(&self, m: &Isometry, g: Geodesic) -> Geodesic;

    /// What [`cross`](Geometry::cross) needs of a pairing of the face `plane`. *Host only.*
    ///
    /// In the geometries with reflections every pairing is a reflection in its face followed by an isometry that,
    /// for a Dirichlet domain, fixes the base point. A state on the face is hardly moved by the reflection, and the
    /// second factor is orthogonal, so a passage costs one rounding where the pairing's own matrix, with entries of
    /// the size of e²ʳ in a hyperbolic cell of inradius r, would cancel digits.
    fn fold(&self, _plane: DVec4, pairing: &Isometry) -> Isometry {
        *pairing
    }

    /// Image of a state on the face `plane` under its pairing, given as [`fold`](Geometry::fold) gives it.
    fn cross(&self, folded: &Isometry, _plane: DVec4, g: Geodesic) -> Geodesic {
        self.apply(folded, g)
    }

    /// `a` after `b`. *Host only.*
    fn compose(&self, a: &Isometry, b: &Isometry) -> Isometry {
        Isometry::linear(a.linear * b.linear)
    }

    /// The inverse isometry. *Host only.*
    fn inverse(&self, m: &Isometry) -> Isometry;

    /// The affine map of the chart by which an isometry acts, or `None` where it acts otherwise. *Host only.*
    fn chart_action(&self, _m: &Isometry) -> Option<DAffine3> {
        None
    }

    /// The affine map of the chart that multiplies the lengths of all geodesics from a point by a positive factor, or `None` where
    /// there is none. *Host only.*
    fn chart_dilation(&self, _point: DVec4, _factor: f64) -> Option<DAffine3> {
        None
    }

    /// How far `m` is from preserving the metric: largest deviation of the defining relation. *Host only.*
    fn isometry_residual(&self, m: &Isometry) -> f64;

    /// The plane of points as far from the base point as from `q`, base point inside, or `None` where such a
    /// bisector is not a plane of the chart. *Host only.*
    fn bisector(&self, q: DVec4) -> Option<DVec4>;

    // --- quadrics -----------------------------------------------------------------------------------

    /// The metric ball, or `None` in a geometry whose balls and tubes are no quadrics of the chart: there they are
    /// drawn as triangles. *Host only.*
    fn ball(&self, centre: DVec4, radius: f64) -> Option<Quadric>;

    /// The tube of points nearer than `radius` to the whole geodesic `axis`; `None` where balls are. *Host only.*
    fn tube(&self, axis: Geodesic, radius: f64) -> Option<Quadric>;
}

/// A start this far outside a face plane (in the plane's own units) still counts as inside: the rounding of one
/// crossing in f64. The shaders use their own value for f32 (`shader_io`).
pub const ON_FACE: f64 = 1e-12;

/// Directions whose product with a face plane is smaller than this run along the face. In a cell of diameter 1
/// such a ray moves off the face by less than [`ON_FACE`] before another face stops it.
pub const ALONG_FACE: f64 = 1e-13;

macro_rules! register {
    ($(($type:ident, $module:ident, $name:literal, [$($alias:literal),*], $title:literal),)*) => {
        $(#[doc = concat!("See [`", stringify!($module), "`].")] pub use $module::$type;)*

        /// Identifies a registered geometry.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum GeometryId { $(#[doc = $title] $type),* }

        /// All registered geometries.
        pub const GEOMETRIES: &[Entry] = &[$(Entry {
            id: GeometryId::$type,
            name: $name,
            aliases: &[$($alias),*],
            title: $title,
            module: stringify!($module),
        }),*];

        /// Runs `visitor` with the geometry's own type: the only dispatch on geometries in the program.
        pub fn visit<V: Visitor>(id: GeometryId, visitor: V) -> V::Output {
            match id { $(GeometryId::$type => visitor.visit($module::$type)),* }
        }
    };
}
geometries!(register);

/// A line of the registry.
#[derive(Debug)]
pub struct Entry {
    /// Identifier.
    pub id: GeometryId,
    /// Name on the command line and in scenes.
    pub name: &'static str,
    /// Other names accepted.
    pub aliases: &'static [&'static str],
    /// What people call it.
    pub title: &'static str,
    /// Stem of the two files.
    pub module: &'static str,
}

/// Code that is generic in the geometry, run by [`visit`].
pub trait Visitor {
    /// What it computes.
    type Output;
    /// The code.
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output;
}

impl GeometryId {
    /// The registry's line.
    pub fn entry(self) -> &'static Entry {
        // The enum and the slice come from the same list, so the index is always in range.
        &GEOMETRIES[self as usize]
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// Looks a name or an alias up.
    pub fn from_name(name: &str) -> Option<Self> {
        GEOMETRIES.iter().find(|e| e.name == name || e.aliases.contains(&name)).map(|e| e.id)
    }

    /// Whether balls and tubes are quadrics of the chart.
    pub fn has_quadrics(self) -> bool {
        struct Quadrics;
        impl Visitor for Quadrics {
            type Output = bool;
            fn visit<G: Geometry>(self, geometry: G) -> bool {
                geometry.ball(geometry.base(), 0.1).is_some()
            }
        }
        visit(self, Quadrics)
    }

    /// Whether all geodesics are straight in the chart.
    pub fn is_straight(self) -> bool {
        struct Straight;
        impl Visitor for Straight {
            type Output = bool;
            fn visit<G: Geometry>(self, _geometry: G) -> bool {
                G::STRAIGHT
            }
        }
        visit(self, Straight)
    }

    /// How many numbers a point or a vector has for the user.
    pub fn components(self) -> usize {
        struct Components;
        impl Visitor for Components {
            type Output = usize;
            fn visit<G: Geometry>(self, geometry: G) -> usize {
                geometry.components()
            }
        }
        visit(self, Components)
    }

    /// How many numbers a direction has for the user.
    pub fn direction_components(self) -> usize {
        struct Components;
        impl Visitor for Components {
            type Output = usize;
            fn visit<G: Geometry>(self, geometry: G) -> usize {
                geometry.direction_components()
            }
        }
        visit(self, Components)
    }
}

/// Point and unit direction from the user's numbers: the point is put on the model, the direction made tangent
/// and normalised whatever its scale; where the metric is indefinite it keeps its length.
///
/// # Errors
/// [`GeometryError::NotAPoint`] or [`GeometryError::NoDirection`] with the offending numbers.
pub fn settle_geodesic<G: Geometry>(
    geometry: G,
    name: &'static str,
    point: DVec4,
    direction: DVec4,
) -> Result<Geodesic, GeometryError> {
    let p = geometry
        .settle(point)
        .filter(|p| p.is_finite())
        .ok_or_else(|| GeometryError::NotAPoint(components_text(geometry, point), name))?;
    let no_direction = || GeometryError::NoDirection(components_text(geometry, direction));
    // Scaling by the largest component first keeps squares of 1e±200 in range.
    let scale = direction.abs().max_element();
    if !(direction.is_finite() && scale > 0.0) {
        return Err(no_direction());
    }
    if geometry.signature() != DVec3::ONE {
        return Ok(Geodesic { point: p, velocity: geometry.settle_tangent(p, direction) });
    }
    let v = geometry.settle_tangent(p, direction / scale);
    let norm = geometry.norm(p, v);
    // A direction that is normal to the model up to rounding has only noise for a tangent part.
    if !(norm.is_finite() && norm > 1e-14) {
        return Err(no_direction());
    }
    Ok(Geodesic { point: p, velocity: v / norm })
}

fn components_text<G: Geometry>(geometry: G, v: DVec4) -> String {
    let shown: Vec<String> = v.to_array()[..geometry.components()].iter().map(|x| x.to_string()).collect();
    format!("({})", shown.join(", "))
}

/// `a.hypot(b)`, in a tenth of the time where the squares are ordinary numbers.
fn hypotenuse<T: Elementary>(a: T, b: T) -> T {
    let square = a * a + b * b;
    let ordinary = square > T::SMALLEST / T::from_f64(T::EPSILON) && square < T::from_f64(f64::INFINITY);
    if ordinary { square.sqrt() } else { a.hypot(b) }
}

/// End point of the geodesic that leaves `p` with velocity `w` (any length, zero included) after unit time.
pub fn exponential<G: Geometry>(geometry: G, p: DVec4, w: DVec4) -> DVec4 {
    let norm = geometry.norm(p, w);
    if norm == 0.0 { p } else { geometry.flow(Geodesic { point: p, velocity: w / norm }, norm).point }
}

/// The isometry that carries one point with an orthonormal frame to another, or `None` where there is none that is
/// linear in the coordinates: not every geometry has one for every turn.
pub fn carry<G: Geometry>(geometry: G, from: (DVec4, [DVec4; 3]), to: (DVec4, [DVec4; 3])) -> Option<Isometry> {
    let columns = |(p, [x, y, z]): (DVec4, [DVec4; 3])| DMat4::from_cols(x, y, z, p);
    let isometry = Isometry::linear(columns(to) * columns(from).inverse());
    // Rounding of the inverse grows with the entries.
    let size = isometry.linear.to_cols_array().iter().fold(1.0, |m: f64, x| m.max(x.abs()));
    let arrives = (0..3).all(|i| {
        let image = geometry.apply(&isometry, Geodesic { point: from.0, velocity: from.1[i] });
        (image.point - to.0).abs().max((image.velocity - to.1[i]).abs()).max_element() <= 1e-9 * size
    });
    (arrives && geometry.isometry_residual(&isometry) <= 1e-9 * size * size).then_some(isometry)
}

/// Two unit vectors normal to a unit vector and to each other.
pub fn across<G: Geometry>(geometry: G, g: Geodesic) -> [DVec4; 2] {
    let axes = geometry.frame(g.point);
    // The two frame vectors that the velocity is least along.
    let mut order = [0, 1, 2];
    let along = axes.map(|axis| geometry.inner(g.point, axis, g.velocity).abs());
    order.sort_by(|&a, &b| along[a].total_cmp(&along[b]));
    let [_, u, v] = orthonormalise(geometry, g.point, [g.velocity, axes[order[0]], axes[order[1]]]);
    [u, v]
}

/// Gram–Schmidt in the metric at `p`, keeping the direction of the first vector.
pub fn orthonormalise<G: Geometry>(geometry: G, p: DVec4, mut frame: [DVec4; 3]) -> [DVec4; 3] {
    for i in 0..3 {
        for j in 0..i {
            frame[i] -= frame[j] * geometry.inner(p, frame[i], frame[j]);
        }
        frame[i] /= geometry.norm(p, frame[i]);
    }
    frame
}

/// Rows of a 4×4 matrix as they are printed, to glam's columns.
pub fn matrix_from_rows(rows: [[f64; 4]; 4]) -> DMat4 {
    DMat4::from_cols_array_2d(&rows).transpose()
}

/// The matrix of a linear map.
pub(crate) fn matrix_of(map: impl Fn(DVec4) -> DVec4) -> DMat4 {
    DMat4::from_cols(map(DVec4::X), map(DVec4::Y), map(DVec4::Z), map(DVec4::W))
}

/// `xyz` of a vector, for the geometries whose chart covectors are spatial parts.
pub(crate) fn spatial(v: DVec4) -> DVec3 {
    v.xyz()
}
