//! What a scene needs, decided without a device.
//!
//! A [`Plan`] turns into specialization constants and into the list of buffers and structures that the host
//! creates. Nothing that the plan leaves out exists at run time: no code in the compiled shader, no buffer, no
//! ray. `--stats` prints it; [`Plan::keep`] puts features back in, so that benches can measure what leaving them
//! out saves.

use crate::{
    integrate::Method,
    scene::{Scene, Shading, Shape},
    shader_io::{Specialization, UNROLLED_FACES},
};

/// A part of the renderer that a scene may do without.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Feature {
    /// Triangles: their buffers, boxes and tests.
    Meshes,
    /// Quadrics: their buffer, boxes and intersection stage.
    Quadrics,
    /// The any-hit stage, which looks into textures during traversal.
    AlphaMask,
    /// Texture lookups and the texel buffer.
    Textures,
    /// Colours from the chart's coordinates.
    Coordinates,
    /// Point lights.
    Lights,
    /// Shadow rays.
    Shadows,
    /// The light at the viewer.
    Headlight,
    /// Fog.
    Fog,
    /// The test of geodesics against a largest length.
    MaxDistance,
    /// The length of primary rays, from the source to where they end.
    Lengths,
    /// The automaton that labels cells by deck elements.
    Labels,
    /// Counting of work.
    Counters,
}

impl Feature {
    /// All features with their names in `--stats` and `--keep`.
    pub const NAMES: &[(&'static str, Feature)] = &[
        ("meshes", Self::Meshes),
        ("quadrics", Self::Quadrics),
        ("alpha-mask", Self::AlphaMask),
        ("textures", Self::Textures),
        ("coordinates", Self::Coordinates),
        ("lights", Self::Lights),
        ("shadows", Self::Shadows),
        ("headlight", Self::Headlight),
        ("fog", Self::Fog),
        ("max-distance", Self::MaxDistance),
        ("lengths", Self::Lengths),
        ("labels", Self::Labels),
        ("counters", Self::Counters),
    ];

    /// Name in `--stats` and `--keep`.
    pub fn name(self) -> &'static str {
        // Every variant is in the list: test `plan::every_feature_has_a_name`.
        Self::NAMES.iter().find(|(_, feature)| *feature == self).map_or("", |(name, _)| name)
    }
}

/// A decision about one feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// What is decided about.
    pub feature: Feature,
    /// Whether the scene's pictures need it.
    pub needed: bool,
    /// Whether it is kept in all the same, to measure what leaving it out saves.
    pub kept: bool,
    /// Why it is needed or not.
    pub reason: &'static str,
}

/// Which parts of the renderer a scene needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// One decision per feature, in the order of [`Feature::NAMES`].
    pub decisions: Vec<Decision>,
    /// What the picture shows.
    pub shading: Shading,
    /// How rays are followed.
    pub method: Method,
    /// Number of faces if the space has one cell with few enough to unroll, else 0: then rays remember their cell.
    pub faces: u32,
    /// What the pictures are for.
    pub purpose: Purpose,
    /// What pixels cost, which they show instead of what is seen.
    pub heat: Option<Heat>,
}

/// What a pixel costs, samples and shadow rays together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heat {
    /// Segments of primary rays.
    Segments,
    /// Passages of primary rays through faces.
    Bounces,
    /// Nodes of the hierarchy, of primary and shadow rays.
    Nodes,
    /// Time: ticks of the device's clock, nanoseconds of work on the cpu.
    Time,
}

impl Heat {
    /// All with their names on the command line.
    pub const NAMES: &[(&'static str, Heat)] =
        &[("segments", Self::Segments), ("bounces", Self::Bounces), ("nodes", Self::Nodes), ("time", Self::Time)];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, heat)| *heat == self).map_or("", |(name, _)| name)
    }

    /// The counter that says so, indexed as [`super::Stats::counts`]; none for time.
    pub fn counter(self) -> Option<u32> {
        use crate::shader_io as io;
        match self {
            Self::Segments => Some(io::COUNT_SEGMENTS),
            Self::Bounces => Some(io::COUNT_BOUNCES),
            Self::Nodes => Some(io::COUNT_NODES),
            Self::Time => None,
        }
    }
}

/// What pictures are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Purpose {
    /// A picture: the sum of its samples.
    #[default]
    Picture,
    /// The eyes of a headset: colours and distances, one sample each.
    Eyes {
        /// Only some pixels have rays.
        listed: bool,
    },
}

impl Plan {
    /// Decides what pictures of `scene` need; `count` asks for work counters.
    pub fn new(scene: &Scene, count: bool) -> Self {
        let shading = scene.settings.shading;
        let lit = shading == Shading::Riemannian;
        let has_mesh = scene.objects.iter().any(|o| o.shape.is_flat());
        let has_round = scene.objects.iter().any(|o| !o.shape.is_flat());
        let placed = used_materials(scene).any(|m| scene.materials[m].coordinates.is_some());
        let quadrics = scene.space.geometry.has_quadrics();
        let mut materials = used_materials(scene);
        let masked = materials.any(|m| scene.materials[m].alpha_cutoff.is_some());
        let textured = used_materials(scene).any(|m| {
            let m = &scene.materials[m];
            m.base_texture.is_some() || m.surface_texture.is_some()
        });
        let lights = !scene.lights.is_empty();
        let headlight = scene.settings.headlight != [0.0; 3];
        let shadowing = scene.lights.iter().any(|l| l.shadows);
        let decide = |feature| {
            let (needed, reason) = match feature {
                Feature::Meshes if has_round && !quadrics => (true, "balls and tubes are made of triangles here"),
                Feature::Meshes => pick(has_mesh, "an object is made of triangles", "no object is made of triangles"),
                Feature::Quadrics if has_round && !quadrics => (false, "balls and tubes are no quadrics here"),
                Feature::Quadrics => pick(has_round, "an object is a ball or a tube", "no object is a ball or a tube"),
                Feature::AlphaMask => pick(masked, "a material has an alpha mask", "no material has an alpha mask"),
                Feature::Textures if !lit && !masked => (false, "the shading shows no colours of surfaces"),
                Feature::Textures => pick(textured, "a material has a texture", "no material has a texture"),
                Feature::Coordinates if !lit => (false, "the shading shows no colours of surfaces"),
                Feature::Coordinates => {
                    pick(placed, "a material is coloured by place", "no material is coloured by place")
                }
                Feature::Lights | Feature::Shadows | Feature::Headlight | Feature::Fog if !lit => {
                    (false, "the shading shows no light")
                }
                Feature::Lights => pick(lights, "the scene has point lights", "the scene has no point light"),
                Feature::Shadows => pick(shadowing, "a light throws shadows", "no light throws shadows"),
                Feature::Headlight => pick(headlight, "there is a light at the viewer", "no light at the viewer"),
                Feature::Fog => pick(scene.settings.fog > 0.0, "the scene has fog", "the scene has no fog"),
                Feature::MaxDistance => pick(
                    scene.settings.max_distance.is_some(),
                    "geodesics end at a largest length",
                    "only bounces limit geodesics",
                ),
                Feature::Lengths if scene.settings.max_distance.is_some() => {
                    (true, "geodesics end at a largest length")
                }
                Feature::Lengths if !scene.space.geometry.is_straight() => (true, "arcs may err in proportion to it"),
                Feature::Lengths => pick(
                    shading == Shading::Distance || lit && (headlight || scene.settings.fog > 0.0),
                    "the length of rays shows in the picture",
                    "the length of rays does not show in the picture",
                ),
                Feature::Labels => pick(
                    shading == Shading::Cell,
                    "the shading shows deck elements",
                    "the shading shows no deck elements",
                ),
                Feature::Counters => pick(count, "work is counted for --stats", "nobody asked for work counts"),
            };
            Decision { feature, needed, kept: false, reason }
        };
        let decisions = Feature::NAMES.iter().map(|(_, feature)| decide(*feature)).collect();
        let faces = unrolled_faces(scene.space.cells.iter().map(|cell| cell.faces.len()));
        Self { decisions, shading, method: scene.settings.method, faces, purpose: Purpose::Picture, heat: None }
    }

    /// The same for another purpose.
    pub fn serving(self, purpose: Purpose) -> Self {
        let mut plan = Self { purpose, ..self };
        let lengths = plan.decisions.iter_mut().find(|d| d.feature == Feature::Lengths);
        if let Some(lengths) = lengths.filter(|_| purpose != Purpose::Picture) {
            (lengths.needed, lengths.reason) = (true, "eyes have depths");
        }
        plan
    }

    /// The same with pictures of what pixels cost. The plan must count.
    pub fn showing(self, heat: Option<Heat>) -> Self {
        Self { heat, ..self }
    }

    /// Keeps features in that the scene does not need.
    pub fn keep(mut self, features: &[Feature]) -> Self {
        for decision in &mut self.decisions {
            decision.kept |= !decision.needed && features.contains(&decision.feature);
        }
        self
    }

    /// Whether the feature is compiled in.
    pub fn uses(&self, feature: Feature) -> bool {
        self.decisions.iter().any(|d| d.feature == feature && (d.needed || d.kept))
    }

    /// The shader constants that carry the plan out.
    pub fn specialization(&self) -> Specialization {
        let on = |feature| u32::from(self.uses(feature));
        Specialization {
            faces: self.faces,
            meshes: on(Feature::Meshes),
            quadrics: on(Feature::Quadrics),
            alpha_mask: on(Feature::AlphaMask),
            textures: on(Feature::Textures),
            coordinates: on(Feature::Coordinates),
            lights: on(Feature::Lights),
            shadows: on(Feature::Shadows),
            headlight: on(Feature::Headlight),
            fog: on(Feature::Fog),
            max_distance: on(Feature::MaxDistance),
            lengths: on(Feature::Lengths),
            labels: on(Feature::Labels),
            counters: on(Feature::Counters),
            shading: shading_number(self.shading),
            integrator: integrator_number(self.method),
            eyes: (self.purpose != Purpose::Picture).into(),
            listed: (self.purpose == Purpose::Eyes { listed: true }).into(),
            heat: self.heat.and_then(Heat::counter).map_or(0, |counter| counter + 1),
            together: 0,
            guarded: 0,
            mesh_guards: 0,
            quadric_guards: 0,
        }
    }
}

fn pick(condition: bool, yes: &'static str, no: &'static str) -> (bool, &'static str) {
    (condition, if condition { yes } else { no })
}

/// Materials that objects of the scene show, with repetitions.
fn used_materials(scene: &Scene) -> impl Iterator<Item = usize> {
    scene.objects.iter().flat_map(|object| {
        let own: Box<dyn Iterator<Item = usize>> = match (object.material, object.shape) {
            (Some(material), _) => Box::new(std::iter::once(material)),
            (None, Shape::Mesh(mesh)) => Box::new(scene.meshes[mesh].triangles.iter().map(|t| t.1)),
            (None, _) => Box::new(std::iter::empty()),
        };
        own
    })
}

/// The number of faces for which face tests are unrolled, from those of all cells: 0 for a loop.
pub fn unrolled_faces(mut cells: impl Iterator<Item = usize>) -> u32 {
    match (cells.next(), cells.next()) {
        (Some(faces), None) if faces <= UNROLLED_FACES as usize => faces as u32,
        _ => 0,
    }
}

/// The number by which the shaders know an integrator.
pub fn integrator_number(method: Method) -> u32 {
    use crate::shader_io as io;
    match method {
        Method::Exact => io::INTEGRATOR_EXACT,
        Method::Euler { .. } => io::INTEGRATOR_EULER,
        Method::Rk4 { .. } => io::INTEGRATOR_RK4,
        Method::Dopri5 { .. } => io::INTEGRATOR_DOPRI5,
    }
}

/// The number by which the shaders know a shading.
pub fn shading_number(shading: Shading) -> u32 {
    use crate::shader_io as io;
    match shading {
        Shading::Riemannian => io::SHADING_RIEMANNIAN,
        Shading::Normals => io::SHADING_NORMALS,
        Shading::Distance => io::SHADING_DISTANCE,
        Shading::Bounces => io::SHADING_BOUNCES,
        Shading::Segments => io::SHADING_SEGMENTS,
        Shading::Cell => io::SHADING_CELL,
        Shading::Object => io::SHADING_OBJECT,
    }
}
