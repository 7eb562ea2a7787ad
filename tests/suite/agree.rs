//! The three backends draw the same picture: rt and compute (f32 on the device) that of the cpu (f64), and on one driver
//! rt that of compute (exactly, where the driver is software).
//!
//! Compared are 8-bit sRGB values, as a viewer sees them. At least 99.9 % of the pixels must be within 2/255 (where
//! geodesics are walked in arcs, as many as the roundings of f32 allow: `Reference::curved_limit`), and each of the others
//! must lie on an outline: a pixel in whose 3 × 3 neighbourhood (5 × 5 where geodesics are curves) the reference changes its
//! object or its number of bounces, or its colour by more than a smooth surface does (outlines of shadows and textures).

use crate::support;
use holonomy::{
    render::{
        Backend, Shot, Target,
        compute::ComputeBackend,
        cpu::CpuBackend,
        plan::Plan,
        rt::{RtBackend, RtOptions},
        world::World,
    },
    scene::{Scene, Shading, file, folder::Folder},
    shader_io as io,
    space::catalogue,
    vulkan::{Context, DeviceKind},
};
use std::sync::Arc;

/// Width and height of the pictures: where geodesics are straight in the chart, and where they are walked in arcs, which
/// takes several times as long.
const SIZE: u32 = 512;
const CURVED_SIZE: u32 = 256;
const BOUNCES: u32 = 8;

/// Largest difference of 8-bit values that counts as equal.
const EQUAL: i32 = 2;
/// Smallest share of equal pixels.
const SHARE: f64 = 0.999;
/// Roundings of f32 that a path's state is off by after each segment, where geodesics are walked in arcs: what the flows are
/// held to (`geodesic_`: at most 4.2 roundings), and one passage.
const ROUNDINGS: f64 = 5.0;
/// A step of 8-bit values between neighbours that no smooth shading makes.
const OUTLINE_STEP: i32 = 12;

fn scene(name: &str, shading: Shading) -> Scene {
    let mut scene = file::load(name).expect("shipped scenes load");
    scene.settings.bounces = BOUNCES;
    scene.settings.shading = shading;
    scene
}

fn is_straight(scene: &Scene) -> bool {
    scene.space.geometry.is_straight()
}

/// Width and height of the pictures of a scene.
fn size(scene: &Scene) -> u32 {
    if is_straight(scene) { SIZE } else { CURVED_SIZE }
}

fn draw(backend: &mut dyn Backend, scene: &Scene) -> Target {
    draw_counted(backend, scene).0
}

/// Segments of a picture's rays per crossing of a cell (1 where geodesics are straight in the chart, else arcs), and per ray.
struct Arcs {
    per_crossing: f64,
    per_ray: f64,
}

/// The picture, and what its rays took.
fn draw_counted(backend: &mut dyn Backend, scene: &Scene) -> (Target, Arcs) {
    let plan = Plan::new(scene, true);
    let world = Arc::new(World::new(scene, &plan, scene.observer.frame).expect("shipped scenes fit"));
    backend.load(&world).expect("the world loads");
    let size = [size(scene); 2];
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, size);
    let mut target = Target::new(size);
    let stats = backend.render(&shot, &mut target, &|_| ()).expect("the picture is drawn");
    assert_eq!(stats.counts[io::COUNT_LOST as usize], 0, "no ray is lost");
    let count = |index: u32| stats.counts[index as usize] as f64;
    let [segments, bounces, rays] = [io::COUNT_SEGMENTS, io::COUNT_BOUNCES, io::COUNT_RAYS].map(count);
    (target, Arcs { per_crossing: segments / (bounces + rays), per_ray: segments / rays })
}

fn srgb(target: &Target) -> Vec<[i32; 3]> {
    use holonomy::cli::output::srgb_byte;
    target.pixels.iter().map(|p| [p[0], p[1], p[2]].map(|x| i32::from(srgb_byte(x)))).collect()
}

fn step(a: [i32; 3], b: [i32; 3]) -> i32 {
    (0..3).map(|i| (a[i] - b[i]).abs()).max().unwrap_or(0)
}

/// What the reference knows of a picture.
struct Reference {
    size: usize,
    /// Largest share of pixels that may differ.
    limit: f64,
    /// Pixels from an outline at which they may: frames seen from their edges are thinner than a pixel, so that only every
    /// other pixel along them shows them.
    within: i64,
    colors: Vec<[i32; 3]>,
    objects: Vec<f32>,
    bounces: Vec<f32>,
}

impl Reference {
    fn new(name: &str) -> Self {
        let mut cpu = CpuBackend::default();
        let raw = |target: Target| target.pixels.iter().map(|p| p[0]).collect();
        let lit = scene(name, Shading::Riemannian);
        let (colors, arcs) = draw_counted(&mut cpu, &lit);
        let mut reference = Self {
            size: size(&lit) as usize,
            limit: 1.0 - SHARE,
            within: if is_straight(&lit) { 1 } else { 2 },
            colors: srgb(&colors),
            objects: raw(draw(&mut cpu, &scene(name, Shading::Object))),
            bounces: raw(draw(&mut cpu, &scene(name, Shading::Bounces))),
        };
        if !is_straight(&lit) {
            reference.limit = reference.curved_limit(&arcs, lit.observer.fov);
        }
        reference
    }

    /// The share of pixels that may differ where geodesics are walked in arcs. Each of a ray's segments adds [`ROUNDINGS`]
    /// roundings to its state. Those across the ray move what is seen by that angle, or less if geodesics part on the way: so
    /// many pixels. An outline that is displaced by δ pixels changes the share 2δ of the pixels along it, and a pixel is
    /// taken to be along one if its neighbourhood shows it. Four pixels more, because shares of few are chance.
    fn curved_limit(&self, arcs: &Arcs, fov: f64) -> f64 {
        let pixel = 2.0 * (0.5 * fov.to_radians()).tan() / self.size as f64;
        let displacement = arcs.per_ray * ROUNDINGS * f64::from(f32::EPSILON) / 2.0 / pixel;
        let pixels = self.colors.len();
        let outlines = (0..pixels).filter(|i| self.is_outline(*i, 1)).count();
        (2.0 * displacement * outlines as f64 + 4.0) / pixels as f64
    }

    /// Whether something changes within so many pixels.
    fn is_outline(&self, index: usize, within: i64) -> bool {
        let w = self.size as i64;
        let (x, y) = (index as i64 % w, index as i64 / w);
        (-within..=within).any(|dy| {
            (-within..=within).any(|dx| {
                let (nx, ny) = (x + dx, y + dy);
                let inside = (0..w).contains(&nx) && (0..w).contains(&ny);
                let n = (ny * w + nx) as usize;
                inside
                    && (self.objects[n] != self.objects[index]
                        || self.bounces[n] != self.bounces[index]
                        || step(self.colors[n], self.colors[index]) > OUTLINE_STEP)
            })
        })
    }

    /// Why the other picture does not agree, or the share of its pixels that differ.
    fn judge(&self, other: &[[i32; 3]]) -> Result<f64, String> {
        self.judge_both(&self.colors, other)
    }

    /// The same for two pictures of which neither is the reference.
    fn judge_both(&self, one: &[[i32; 3]], other: &[[i32; 3]]) -> Result<f64, String> {
        let differing: Vec<usize> = (0..other.len()).filter(|i| step(one[*i], other[*i]) > EQUAL).collect();
        let share = differing.len() as f64 / other.len() as f64;
        if share > self.limit {
            return Err(format!("{:.4} % of the pixels differ, {:.4} % may", 100.0 * share, 100.0 * self.limit));
        }
        match differing.iter().find(|i| !self.is_outline(**i, self.within)) {
            Some(i) => Err(format!(
                "pixel ({}, {}) is on no outline but is {:?} instead of {:?}",
                i % self.size,
                i / self.size,
                other[*i],
                one[*i]
            )),
            None => Ok(share),
        }
    }
}

fn compute(context: &Arc<Context>) -> ComputeBackend {
    ComputeBackend::new(context).expect("the backend can be made")
}

/// Smallest share of pixels whose 8-bit values are equal in rt and compute on one driver of software. Traversals round
/// differently, so within a rounding of an edge they may select another triangle; everything else is the same code. That may
/// happen once with each segment, so where a crossing of a cell takes several arcs so many times more pixels may differ.
/// Hardware contracts other products into additions in each pipeline: there the two are compared as each is with the cpu.
const EXACT_SHARE: f64 = 0.9999;

/// Why the pictures are not equal, or the share of pixels that differ. `arcs`: segments per crossing.
fn judge_exactly(a: &[[i32; 3]], b: &[[i32; 3]], arcs: f64) -> Result<f64, String> {
    let differing = a.iter().zip(b).filter(|(a, b)| a != b).count();
    let share = differing as f64 / a.len() as f64;
    if share <= (1.0 - EXACT_SHARE) * arcs && a.len() == b.len() {
        Ok(share)
    } else {
        Err(format!("{differing} of {} pixels are not equal", a.len()))
    }
}

fn agrees(name: &str) {
    let reference = Reference::new(name);
    let scene = scene(name, Shading::Riemannian);
    let judge = |what: &str, drawn: &[[i32; 3]]| match reference.judge(drawn) {
        Ok(share) => {
            let [share, limit] = [share, reference.limit].map(|x| 100.0 * x);
            println!(
                "{name}: {what} against cpu: {share:.4} % of the pixels differ, all on outlines; {limit:.4} % may"
            );
        }
        Err(why) => panic!("{name}: {what}: {why}"),
    };
    if let Some(gpu) = support::gpu() {
        judge("compute", &srgb(&draw(&mut compute(&gpu), &scene)));
    }
    if let Some(gpu) = support::rt_gpu() {
        let (traced, arcs) = draw_counted(&mut RtBackend::new(&gpu).expect("the backend can be made"), &scene);
        let traced = srgb(&traced);
        judge("rt", &traced);
        let computed = srgb(&draw(&mut compute(&gpu), &scene));
        let judged = match gpu.info().kind {
            DeviceKind::Cpu => judge_exactly(&traced, &computed, arcs.per_crossing),
            _ => reference.judge_both(&traced, &computed),
        };
        match judged {
            Ok(share) => println!("{name}: rt against compute: {:.4} % of the pixels are not equal", 100.0 * share),
            Err(why) => panic!("{name}: rt against compute: {why}"),
        }
    }
}

/// The recursive variant draws the same picture, bit for bit on software, and is refused where the device's recursion is too
/// shallow.
#[test]
fn agree_recursive_variant() {
    let Some(gpu) = support::rt_gpu() else { return };
    let mut scene = scene("poincare", Shading::Riemannian);
    let mut recursive = RtBackend::with_options(&gpu, RtOptions { recursive: true }).expect("the backend can be made");
    let limit = gpu.info().rt().recursion_depth;
    if limit > 8 {
        scene.settings.bounces = 7;
        let looped = draw(&mut RtBackend::new(&gpu).expect("the backend can be made"), &scene);
        let drawn = draw(&mut recursive, &scene);
        let differing = looped.pixels.iter().zip(&drawn.pixels).filter(|(a, b)| a != b).count();
        let may = if gpu.info().kind == DeviceKind::Cpu { 0.0 } else { 1.0 - EXACT_SHARE };
        assert!(
            differing as f64 <= may * drawn.pixels.len() as f64,
            "the recursive variant draws {differing} other pixels"
        );
        assert!(looped.pixels.iter().any(|p| p[0] != looped.pixels[0][0]));
    }
    scene.settings.bounces = limit;
    let plan = Plan::new(&scene, false);
    let world = Arc::new(World::new(&scene, &plan, scene.observer.frame).expect("shipped scenes fit"));
    let error = recursive.load(&world).expect_err("one level too many").to_string();
    let expected = format!("recursion to depth {} is needed, but {} traces to", limit + 1, gpu.info().name);
    assert!(error.starts_with(&expected), "{error}");
}

#[test]
fn agree_torus() {
    agrees("torus");
}

#[test]
fn agree_mirrored_cube() {
    agrees("mirrored-cube");
}

#[test]
fn agree_poincare() {
    agrees("poincare");
}

#[test]
fn agree_seifert_weber() {
    agrees("seifert-weber");
}

#[test]
fn agree_mirrored_dodecahedron() {
    agrees("mirrored-dodecahedron");
}

#[test]
fn agree_sixth_turn() {
    agrees("sixth-turn");
}

#[test]
fn agree_turns() {
    agrees("half-turn");
    agrees("third-turn");
    agrees("quarter-turn");
}

#[test]
fn agree_hantzsche_wendt() {
    agrees("hantzsche-wendt");
}

#[test]
fn agree_several_cells() {
    agrees("s3");
}

#[test]
fn agree_whole_geometries() {
    agrees("e3");
    agrees("h3");
}

#[test]
fn agree_s2xs1() {
    agrees("s2xs1");
}

#[test]
fn agree_genus2xs1() {
    agrees("genus2xs1");
}

#[test]
fn agree_nil_heisenberg() {
    agrees("nil-heisenberg");
}

#[test]
fn agree_sol_golden() {
    agrees("sol-golden");
}

#[test]
fn agree_sl2_genus2_tangent() {
    agrees("sl2-genus2-tangent");
}

#[test]
fn agree_whole_products() {
    agrees("s2xr");
    agrees("h2xr");
}

#[test]
fn agree_whole_groups() {
    agrees("nil");
    agrees("sol");
    agrees("sl2");
}

#[test]
fn agree_trace_form() {
    agrees("sl2-trace");
}

#[test]
fn agree_book_nil() {
    agrees("book-nil");
}

#[test]
fn agree_book_sol() {
    agrees("book-sol");
}

#[test]
fn agree_alpha_mask() {
    agrees("leaves");
}

#[test]
fn agree_things_in_motion() {
    agrees("drift");
}

#[test]
fn agree_many_triangles() {
    agrees("knot");
}

#[test]
fn agree_benches() {
    agrees("bench-edges");
    agrees("bench-tubes");
    agrees("bench-torus");
}

#[test]
fn agree_benches_of_triangles() {
    agrees("bench-tori");
    agrees("bench-tori-fine");
    agrees("bench-nil");
}

/// Every shipped scene is compared by one of the tests above.
#[test]
fn agree_covers_all_shipped_scenes() {
    let here = include_str!("agree.rs");
    for name in holonomy::scene::shipped::names() {
        // An empty cell shows its background.
        assert!(name == "bench-cell" || here.contains(&format!("agrees({name:?})")), "{name} is not compared");
    }
}

/// Nodes with fewer children than they have room for keep boxes of nothing, one point at the upper corner of all boxes. A ray
/// that passes exactly there meets what is behind, and comes to an end.
#[test]
fn agree_at_the_upper_corner_of_all_boxes() {
    let Some(gpu) = support::gpu() else { return };
    let text = "[space]\ngeometry = \"e3\"\n\
        [observer]\nposition = [0.7, 0.7, 0.7]\nlook = [-1, -1, -1]\nfov = 60\n\
        [render]\nambient = [1, 1, 1]\nmax-distance = 10\n\
        [[object]]\nkind = \"ball\"\nposition = [0, 0, 0]\nradius = 0.25\nmaterial = \"m\"\n[[material]]\nname = \"m\"\n";
    let scene = file::read("corner.toml", text.as_bytes(), &Folder::Embedded).unwrap_or_else(|e| panic!("{e}"));
    let world = Arc::new(World::new(&scene, &Plan::new(&scene, false), scene.observer.frame).expect("the world fits"));
    // The one at the centre of an odd number of pixels.
    const ODD: [u32; 2] = [5, 5];
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, ODD);
    let shows = |backend: &mut dyn Backend| {
        backend.load(&world).expect("the world loads");
        let mut target = Target::new(ODD);
        backend.render(&shot, &mut target, &|_| ()).expect("the picture is drawn");
        srgb(&target)
    };
    let expected = shows(&mut CpuBackend::default());
    assert_ne!(expected[12], expected[0], "the ball is at the centre");
    assert_eq!(shows(&mut compute(&gpu)), expected);
}

/// Raw values agree too: within rounding where both hit the same thing.
#[test]
fn agree_raw_values() {
    let Some(gpu) = support::gpu() else { return };
    for shading in [Shading::Distance, Shading::Bounces, Shading::Segments, Shading::Cell, Shading::Object] {
        // Not in hyperbolic space: values without fog at a distance of 8 bounces change several times a pixel.
        let scene = scene("poincare", shading);
        let a = draw(&mut CpuBackend::default(), &scene);
        let b = draw(&mut compute(&gpu), &scene);
        let same = |x: f32, y: f32| x == y || (x - y).abs() <= 1e-4 * (1.0 + y.abs());
        let differing = a.pixels.iter().zip(&b.pixels).filter(|(p, q)| !same(p[0], q[0])).count();
        let share = differing as f64 / a.pixels.len() as f64;
        assert!(share <= 1.0 - SHARE, "{shading:?}: {:.3} % of the values differ", 100.0 * share);
        let distinct = a.pixels.iter().map(|p| p[0].to_bits()).collect::<std::collections::BTreeSet<_>>().len();
        assert!(distinct > 1, "{shading:?} shows nothing");
    }
}

/// The comparison itself: spoiled copies of a picture that passes must not.
#[test]
fn agree_spoiled_pictures_are_caught() {
    assert!(catalogue::NAMES.contains(&"poincare"));
    let reference = Reference::new("poincare");
    let good = reference.colors.clone();
    assert_eq!(reference.judge(&good), Ok(0.0));
    let inside =
        (0..good.len()).find(|i| !reference.is_outline(*i, reference.within)).expect("a picture has smooth parts");
    type Spoil = (&'static str, fn(usize, &mut Vec<[i32; 3]>));
    let spoils: [Spoil; 5] = [
        ("one pixel off an outline", |inside, p| p[inside][1] = (p[inside][1] + 40) % 256),
        ("one channel a little brighter", |_, p| p.iter_mut().for_each(|c| c[0] += EQUAL + 1)),
        ("red and blue swapped", |_, p| p.iter_mut().for_each(|c| c.swap(0, 2))),
        ("shifted by a pixel", |_, p| p.rotate_left(1)),
        ("a black tile", |_, p| (0..32 * 32).for_each(|i| p[(200 + i / 32) * 512 + 200 + i % 32] = [0; 3])),
    ];
    assert_eq!(judge_exactly(&good, &good, 1.0), Ok(0.0));
    for (what, spoil) in spoils {
        let mut spoiled = good.clone();
        spoil(inside, &mut spoiled);
        assert!(reference.judge(&spoiled).is_err(), "{what}: not caught");
        // A single pixel is within what the other comparison permits.
        assert!(what.starts_with("one pixel") || judge_exactly(&good, &spoiled, 1.0).is_err(), "{what}: not caught");
    }
}
