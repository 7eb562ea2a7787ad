//! Pictures of what pixels cost: their sums are the work counters, on every backend, and backends agree on them.

use crate::support;
use holonomy::{
    measure::heatmap::{Scale, color},
    render::{
        Backend, Shot, Stats, Target,
        compute::ComputeBackend,
        cpu::CpuBackend,
        plan::{Heat, Plan},
        rt::RtBackend,
        world::World,
    },
    scene::file,
};
use std::{process::Command, sync::Arc};

const SIZE: [u32; 2] = [40, 30];

/// Pictures in a flat space with meshes, quadrics and shadows, and one in a curved space. Each is a pipeline to compile.
const PICTURES: [(&str, Heat); 4] =
    [("torus", Heat::Segments), ("torus", Heat::Bounces), ("s2xs1", Heat::Segments), ("torus", Heat::Nodes)];

fn draw(backend: &mut dyn Backend, name: &str, heat: Heat) -> Option<(Target, Stats)> {
    let mut scene = file::load(name).expect("a shipped scene");
    scene.settings.bounces = 4;
    let plan = Plan::new(&scene, true).showing(Some(heat));
    backend.check(&plan).ok()?;
    let world = Arc::new(World::new(&scene, &plan, scene.observer.frame).expect("a world"));
    backend.load(&world).expect("it loads");
    let shot = Shot::symmetric(scene.observer.frame, scene.observer.fov, SIZE);
    let mut target = Target::new(SIZE);
    let stats = backend.render(&shot, &mut target, &|_| ()).expect("a picture");
    Some((target, stats))
}

/// Whether the values of all pixels sum up to the counter.
fn adds_up(picture: &Target, stats: &Stats, heat: Heat) -> bool {
    let counter = heat.counter().expect("a counter") as usize;
    Scale::of(picture, 0.0).sum == stats.counts[counter] as f64 && stats.counts[counter] > 0
}

/// Checks the sums of a backend and returns its pictures.
fn sums(backend: &mut dyn Backend, wanted: &[(&str, Heat)]) -> Vec<Target> {
    let mut pictures = Vec::new();
    for &(name, heat) in wanted {
        let (picture, stats) = draw(backend, name, heat).expect("it counts");
        assert!(adds_up(&picture, &stats, heat), "{name} on {}: {heat:?}, {:?}", backend.name(), stats.counts);
        // The sister: a pixel that is off by one is seen.
        let mut spoilt = picture.clone();
        spoilt.pixels[7][0] += 1.0;
        assert!(!adds_up(&spoilt, &stats, heat));
        pictures.push(picture);
    }
    pictures
}

/// Share of the pixels whose values are not equal.
fn differing(a: &[Target], b: &[Target]) -> f64 {
    let pixels = |all: &[Target]| all.iter().flat_map(|t| t.pixels.iter().map(|p| p[0])).collect::<Vec<_>>();
    let (a, b) = (pixels(a), pixels(b));
    assert_eq!(a.len(), b.len());
    a.iter().zip(&b).filter(|(x, y)| x != y).count() as f64 / a.len() as f64
}

/// Rays within a rounding of an outline, an edge of a box or the end of an arc count otherwise in f32.
const ROUNDINGS: f64 = 0.02;

#[test]
fn heatmap_sums_are_the_counters() {
    let reference = sums(&mut CpuBackend::default(), &PICTURES);
    if let Some(gpu) = support::gpu() {
        let found = sums(&mut ComputeBackend::new(&gpu).expect("a backend"), &PICTURES);
        let off = differing(&reference, &found);
        println!("compute: {off} of the pixels count otherwise than cpu");
        assert!(off < ROUNDINGS, "{off}");
        let mut spoilt = found.clone();
        spoilt[2].pixels.iter_mut().step_by(10).for_each(|p| p[0] += 1.0);
        assert!(differing(&reference, &spoilt) > ROUNDINGS, "spoilt pixels are not seen");
    }
    if let Some(gpu) = support::rt_gpu() {
        let mut backend = RtBackend::new(&gpu).expect("a backend");
        // What its traversal looks at is not known, and it says so.
        assert!(draw(&mut backend, "torus", Heat::Nodes).is_none());
        let found = sums(&mut backend, &PICTURES[..3]);
        let off = differing(&reference[..3], &found);
        println!("rt: {off} of the pixels count otherwise than cpu");
        assert!(off < ROUNDINGS, "{off}");
    }
}

/// Time is told where there is a clock, and refused where there is none.
#[test]
fn heatmap_of_time_has_a_time_in_each_pixel() {
    let timed = |backend: &mut dyn Backend| {
        let Some((picture, _)) = draw(backend, "torus", Heat::Time) else { return false };
        let late = picture.pixels.iter().filter(|p| p[0] > 0.0).count();
        assert_eq!(late, picture.pixels.len(), "{}: pixels that took no time", backend.name());
        true
    };
    assert!(timed(&mut CpuBackend::default()) || cfg!(not(unix)), "the cpu has a clock");
    if let Some(gpu) = support::gpu() {
        assert_eq!(timed(&mut ComputeBackend::new(&gpu).expect("a backend")), gpu.info().has_clock());
    }
    if let Some(gpu) = support::rt_gpu() {
        assert_eq!(timed(&mut RtBackend::new(&gpu).expect("a backend")), gpu.info().has_clock());
    }
}

/// In Oklab, by its formulas from linear sRGB, all steps are equal and lightness grows: both to the rounding of f32.
#[test]
fn heatmap_colors_are_uniform() {
    let lab = |rgb: [f32; 3]| {
        let [r, g, b] = rgb.map(f64::from);
        let l = (0.412_221_470_8 * r + 0.536_332_536_3 * g + 0.051_445_992_9 * b).cbrt();
        let m = (0.211_903_498_2 * r + 0.680_699_545_1 * g + 0.107_396_956_6 * b).cbrt();
        let s = (0.088_302_461_9 * r + 0.281_718_837_6 * g + 0.629_978_700_5 * b).cbrt();
        [
            0.210_454_255_3 * l + 0.793_617_785 * m - 0.004_072_046_8 * s,
            1.977_998_495_1 * l - 2.428_592_205 * m + 0.450_593_709_9 * s,
            0.025_904_037_1 * l + 0.782_771_766_2 * m - 0.808_675_766 * s,
        ]
    };
    let uniform = |map: &dyn Fn(f64) -> [f32; 3]| {
        let colors: Vec<[f64; 3]> = (0..=64).map(|i| lab(map(f64::from(i) / 64.0))).collect();
        let steps: Vec<f64> = colors
            .windows(2)
            .map(|pair| (0..3).map(|i| (pair[1][i] - pair[0][i]).powi(2)).sum::<f64>().sqrt())
            .collect();
        let (least, most) = steps.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
        most / least < 1.01 && colors.windows(2).all(|pair| pair[1][0] > pair[0][0])
    };
    assert!(uniform(&color), "steps differ");
    assert!((0..=64).all(|i| color(f64::from(i) / 64.0).iter().all(|c| (0.0..=1.0).contains(c))), "out of the gamut");
    assert!(!uniform(&|share| [share as f32; 3]), "a ramp of light is taken for uniform");
    assert_eq!((color(-1.0), color(7.0)), (color(0.0), color(1.0)));
}

/// The command prints the scale and keeps it in `--stats`; the values are in the EXR file.
#[test]
fn heatmap_command_tells_its_scale() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_holonomy"));
        command.args(["render", "torus", "--size", "32x24", "--bounces", "3", "--backend", "cpu"]).args(args);
        command.current_dir(folder.path()).output().expect("it runs")
    };
    let output = run(&["--heatmap", "nodes", "-o", "x.exr", "--stats", "x.json"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && text.starts_with("heatmap of nodes: darkest "), "{output:?}");
    let stats: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("x.json")).expect("a file")).expect("JSON");
    assert_eq!(stats["heatmap"]["sum"].as_f64(), stats["counts"]["nodes"].as_f64());
    let picture = image::open(folder.path().join("x.exr")).expect("a picture").to_rgb32f();
    let sum: f64 = picture.pixels().map(|p| f64::from(p[0])).sum();
    assert_eq!(Some(sum), stats["counts"]["nodes"].as_f64());
    let most = picture.pixels().map(|p| f64::from(p[2])).fold(0.0, f64::max);
    assert_eq!(Some(most), stats["heatmap"]["most"].as_f64());
    let output = run(&["--heatmap", "segments", "-o", "y.png", "--stats", "y.json"]);
    assert!(output.status.success() && folder.path().join("y.png").is_file());
    for args in
        [&["--heatmap", "heat", "-o", "z.png"][..], &["--heatmap", "nodes", "--frames", "0..2", "-o", "{frame}.png"]]
    {
        let output = run(args);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert_eq!(String::from_utf8_lossy(&output.stderr).lines().count(), 1, "{output:?}");
    }
}
