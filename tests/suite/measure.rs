//! Measurements: the arithmetic of the reference, FLIP, tables and plots, and the report of `accuracy`.

use crate::support::Random;
use glam::DVec3;
use holonomy::{
    geometry::Real,
    measure::{
        double::Double,
        flip::{PIXELS_PER_DEGREE, flip, flip_map},
        picture::{distance_error, picture_error},
        plot::{Plot, Scale, Series},
        quantile,
        reference::Big,
        report::{Cell, Table},
    },
    render::Target,
};
use serde_json::{Value, json};
use std::process::Command;

fn big(x: Double) -> Big {
    &Big::new(x.high) + &Big::new(x.low)
}

/// Error of each operation in units of 2⁻¹⁰⁶, against 192 bits.
fn worst_errors(spoil: f64) -> [f64; 6] {
    let mut random = Random(1971);
    let mut worst = [0.0_f64; 6];
    let number = |random: &mut Random| {
        let high = random.within(0.3, 3.0);
        Double { high, low: high * random.within(-1.0, 1.0) * 1e-17 }
    };
    for _ in 0..300 {
        let (a, b) = (number(&mut random), number(&mut random));
        let root = big(a).sqrt();
        let exp = {
            let (sinh, cosh) = big(a).sinh_cosh();
            &sinh + &cosh
        };
        let pairs = [
            (a + b, &big(a) + &big(b)),
            (a - b, &big(a) - &big(b)),
            (a * b, &big(a) * &big(b)),
            (a / b, &big(a) / &big(b)),
            (a.sqrt(), root),
            (a.exp(), exp),
        ];
        for (worst, (found, exact)) in worst.iter_mut().zip(pairs) {
            let found = Double { low: found.low + spoil, ..found };
            let error = (&big(found) - &exact).to_f64() / (a.high.abs() + b.high.abs() + exact.to_f64().abs());
            *worst = worst.max(error.abs() * 2_f64.powi(106));
        }
    }
    worst
}

#[test]
fn measure_doubles_have_their_digits() {
    let worst = worst_errors(0.0);
    println!("in units of 2^-106: {worst:.1?}");
    // The exponential squares its error eight times over.
    assert!(worst[..5].iter().all(|x| *x < 16.0) && worst[5] < 4096.0, "{worst:?}");
    let spoilt = worst_errors(1e-28);
    assert!(
        spoilt[..5].iter().all(|x| *x > 16.0) && worst_errors(1e-26)[5] > 4096.0,
        "a spoilt digit passes: {spoilt:?}"
    );
    assert!(Double::from_f64(1.0) > Double { high: 1.0, low: -1e-20 } && Double::from_f64(0.0).sqrt().high == 0.0);
}

fn uniform(color: [f32; 3]) -> Target {
    let mut target = Target::new([48, 32]);
    target.pixels.fill([color[0], color[1], color[2], 1.0]);
    target
}

#[test]
fn measure_flip_has_the_values_that_are_known() {
    let grey = uniform([0.2, 0.2, 0.2]);
    assert_eq!(flip(&grey, &grey), 0.0);
    // The greatest difference by definition; without edges nothing else counts.
    let most = flip(&uniform([0.0, 1.0, 0.0]), &uniform([0.0, 0.0, 1.0]));
    assert!((most - 1.0).abs() < 1e-9, "{most}");
    // Two greys differ in lightness alone: pt/(pc·cmax) ΔL^0.7, below the knee.
    let lightness = |y: f64| 116.0 * y.cbrt() - 16.0;
    let (a, b) = (0.2_f64, 0.25_f64);
    let lab = |x: f64, y: f64, z: f64| {
        let (white, f) = (DVec3::new(0.950_470, 1.0, 1.088_830), |t: f64| t.cbrt());
        let (fx, fy, fz) = (f(x / white.x), f(y), f(z / white.z));
        let l = 116.0 * fy - 16.0;
        DVec3::new(l, 5.0 * l * (fx - fy), 2.0 * l * (fy - fz))
    };
    let (green, blue) = (lab(0.357_576_1, 0.715_152_2, 0.119_192_0), lab(0.180_437_5, 0.072_175_0, 0.950_304_1));
    let hyab = (green.x - blue.x).abs() + (green - blue).truncate().y.hypot(green.z - blue.z);
    let expected = 0.95 / (0.4 * hyab.powf(0.7)) * (lightness(b) - lightness(a)).powf(0.7);
    let found = flip(&uniform([a as f32; 3]), &uniform([b as f32; 3]));
    assert!((found - expected).abs() < 1e-3, "{found} instead of {expected}");
    // A thin line is seen more strongly than its colour alone, near it and not far away.
    let mut line = grey.clone();
    (0..32).for_each(|y| line.pixels[y * 48 + 24] = [0.5, 0.5, 0.5, 1.0]);
    let map = flip_map(&grey, &line, PIXELS_PER_DEGREE);
    assert!(map[16 * 48 + 24] > 0.2 && map[16 * 48 + 2] < 1e-6, "{} and {}", map[16 * 48 + 24], map[16 * 48 + 2]);
}

#[test]
fn measure_picture_errors_count_what_differs() {
    let a = uniform([0.5, 0.5, 0.5]);
    let mut b = a.clone();
    b.pixels[..48].fill([0.5, 0.6, 0.5, 1.0]);
    let error = picture_error(&a, &b);
    assert!((error.off - 1.0 / 32.0).abs() < 1e-12, "{error:?}");
    assert!((error.rmse - (0.01_f64 / 3.0 / 32.0).sqrt()).abs() < 1e-6 && error.flip > 0.0, "{error:?}");
    b.pixels[0][0] = f32::INFINITY;
    let distances = distance_error(&a, &b);
    assert_eq!((distances.median, distances.most), (Some(0.0), Some(0.0)));
    assert!((distances.missed - 1.0 / 1536.0).abs() < 1e-12);
    assert_eq!(quantile(&[3.0, 1.0, 2.0, f64::INFINITY], 0.5), Some(3.0));
    assert_eq!(quantile(&[], 0.5), None);
}

#[test]
fn measure_tables_are_read_by_other_programs() {
    let mut table = Table::new("things", "what they are", &["name", "size, m", "note"]);
    table.push(vec!["a \"b\", c".into(), 0.125.into()]);
    table.push(vec!["d".into(), f64::INFINITY.into(), "x".into()]);
    assert_eq!(table.csv(), "name,\"size, m\",note\n\"a \"\"b\"\", c\",0.125,\nd,,x\n");
    let expected = json!([
        {"name": "a \"b\", c", "size, m": 0.125, "note": null}, {"name": "d", "size, m": null, "note": "x"}
    ]);
    assert_eq!(table.json()["rows"], expected);
    assert_eq!(table.rows[0][2], Cell::Empty);
    assert!(
        table.text().lines().nth(2).is_some_and(|line| line.starts_with("a \"b\", c    0.125")),
        "{}",
        table.text()
    );
}

#[test]
fn measure_plots_show_every_series() {
    let plot = |points: Vec<[f64; 2]>| Plot {
        title: String::from("a plot"),
        axes: [String::from("ms"), String::from("error")],
        scale: Scale::Logarithmic,
        series: vec![Series { name: String::from("euler & co"), points }],
        size: [320, 240],
    };
    let svg = plot(vec![[1.0, 1e-3], [10.0, 1e-6], [0.0, 1.0], [f64::NAN, 1.0]]).svg().expect("a plot");
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>") && svg.contains("euler &amp; co"), "{svg}");
    assert_eq!(svg.matches("<circle").count(), 2, "points that logarithms do not have are left out");
    assert!(plot(vec![[0.0, 1.0]]).svg().is_err(), "nothing to draw is no plot");
}

/// The command on a geometry and a scene, small: files with the promised keys, errors that fall with the step.
#[test]
fn measure_accuracy_reports_what_it_promises() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = Command::new(env!("CARGO_BIN_EXE_holonomy"))
        .args(["accuracy", "s2xs1", "--geometry", "sol", "--size", "24x18", "--backend", "cpu", "--limit", "0.5"])
        .args(["--figure", "s2xs1", "--leave-out", "-o"])
        .arg(folder.path())
        .output()
        .expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect(name);
    let report: Value = serde_json::from_str(&read("accuracy.json")).expect("JSON");
    assert_eq!((&report["schema"], &report["command"]), (&json!(1), &json!("accuracy")));
    let rows = |table: &str| report[table]["rows"].as_array().cloned().unwrap_or_default();
    for table in ["geodesics", "reference", "pictures", "picture-reference", "factor", "bounces", "leave-out"] {
        assert!(!rows(table).is_empty(), "{table} is empty");
    }
    let error = |integrator: &str, parameter: f64| {
        let row = rows("geodesics").into_iter().find(|row| {
            row["integrator"] == integrator && row["precision"] == "f64" && row["parameter"].as_f64() == Some(parameter)
        });
        row.and_then(|row| row["error worst"].as_f64()).expect("a row")
    };
    // The closed form has no parameter, and its error says in which numbers it was computed.
    let exact: Vec<(Value, f64)> = rows("geodesics")
        .into_iter()
        .filter(|row| row["integrator"] == "exact" && row["backend"] == "cpu" && row["refused"] == 0.0)
        .map(|row| (row["precision"].clone(), row["error worst"].as_f64().expect("a number")))
        .collect();
    assert!(
        matches!(exact.as_slice(), [(double, a), (single, b)]
            if double == "f64" && *a < 1e-13 && single == "f32" && (1e-9..1e-5).contains(b)),
        "{exact:?}"
    );
    assert!(error("euler", 0.1) > 5.0 * error("euler", 0.01), "Euler's error falls with the step");
    assert!(error("rk4", 0.1) > 1e3 * error("rk4", 0.01), "the error of order 4 falls with the step");
    assert!(error("dopri5", 1e-13) < 1e-10, "the adaptive method keeps its tolerance");
    let reference = &rows("reference")[0];
    assert!(reference["own error"].as_f64().expect("a number") < 1e-14, "{reference}");
    assert!(reference["closed form worst"].as_f64().expect("a number") < 1e-13, "{reference}");
    let pictures = rows("pictures");
    let of = |integrator: &str, key: &str| -> Vec<f64> {
        pictures.iter().filter(|r| r["integrator"] == integrator).filter_map(|r| r[key].as_f64()).collect()
    };
    assert!(of("exact", "backward median").iter().all(|x| *x < 1e-6), "exact rays hit what they should");
    let euler = of("euler", "backward median");
    assert!(euler[0] > 2.0 * euler[euler.len() - 1] && euler[0] > 1e-4, "Euler's rays: {euler:?}");
    assert!(read("accuracy.csv").lines().count() > 30 && read("accuracy.svg").starts_with("<svg"));
    assert!(read("accuracy-pictures-s2xs1.svg").contains("euler cpu"));
    assert!(folder.path().join("accuracy-bounces.png").is_file());
}

/// Clock rates of graphics processors, as the drivers' files and NVIDIA's program write them.
#[test]
fn measure_reads_the_clocks_of_graphics_processors() {
    use holonomy::measure::machine::graphics;
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let file = folder.path().join(name);
        std::fs::create_dir_all(file.parent().expect("a parent")).expect("made");
        std::fs::write(file, text).expect("written");
    };
    write("card0/device/pp_dpm_sclk", "0: 500Mhz \n1: 1450Mhz *\n2: 2400Mhz \n");
    write("card1/gt_act_freq_mhz", "350\n");
    write("card1-DP-1/status", "connected\n");
    write("card2/gt/gt0/rps_act_freq_mhz", "1150\n");
    write("card3/device/pp_dpm_sclk", "nothing of the kind\n");
    let nvidia = "NVIDIA RTX, the second, 1980, 9501\nNVIDIA H100, 1755, [N/A]\n";
    let found: Vec<_> = graphics(folder.path(), Some(nvidia))
        .into_iter()
        .map(|card| {
            (card["name"].as_str().map(str::to_owned), card["clock_mhz"].as_f64(), card["memory_clock_mhz"].as_f64())
        })
        .collect();
    let card = |name: &str, clock: f64, memory: Option<f64>| (Some(name.to_owned()), Some(clock), memory);
    assert_eq!(
        found,
        [
            card("card0", 1450.0, None),
            card("card1", 350.0, None),
            card("card2", 1150.0, None),
            card("NVIDIA RTX, the second", 1980.0, Some(9501.0)),
            card("NVIDIA H100", 1755.0, None),
        ]
    );
    assert!(graphics(&folder.path().join("none"), None).is_empty());
}
