//! The list of stiff and extreme cases: it passes, it is complete, and a spoiled result is caught.

use crate::support;
use holonomy::{
    geometry::GEOMETRIES,
    measure::stability::{self, Bench, Case, Line, On, Reading, Verdict},
    scene::shipped,
    space::catalogue,
};
use std::{collections::BTreeSet, process::Command};

fn run(cases: &[Case], bench: &mut Bench, spoil: impl Fn(&Case, On, &mut Reading)) -> Vec<Line> {
    stability::run(cases, bench, spoil, |_| ())
}

/// All cases of a family, or of all but some.
fn some(keep: impl Fn(&Case) -> bool) -> Vec<Case> {
    stability::cases().into_iter().filter(keep).collect()
}

fn assert_none_fails(lines: &[Line]) {
    let failed: Vec<String> =
        lines.iter().filter(|line| line.verdict == Verdict::Fail).map(|line| format!("{line:?}")).collect();
    assert!(!lines.is_empty());
    assert!(failed.is_empty(), "{} of {} readings fail:\n{}", failed.len(), lines.len(), failed.join("\n"));
}

#[test]
fn stability_list_is_long_and_its_names_are_unique() {
    let cases = stability::cases();
    let names: BTreeSet<&str> = cases.iter().map(|case| case.name.as_str()).collect();
    assert_eq!(names.len(), cases.len(), "two cases have one name");
    assert!(cases.len() >= 200, "{} cases", cases.len());
}

/// Each family has cases for every geometry or every space that it concerns.
#[test]
fn stability_families_cover_what_they_concern() {
    let cases = stability::cases();
    let has = |family: &str, subject: &str| cases.iter().any(|case| case.family == family && case.subject == subject);
    for entry in GEOMETRIES {
        for family in ["geodesic", "direction-scale", "denormal", "edge"] {
            assert!(has(family, entry.name), "{family} has no case for the geometry {}", entry.name);
        }
        // The trace form is no metric: a mesh has no size in it.
        assert!(entry.name == "sl2-trace" || has("mesh-scale", entry.name), "no mesh in {}", entry.name);
    }
    for name in catalogue::NAMES {
        for family in ["walk", "label", "corner", "observer", "camera", "light", "backward", "forward", "too-large"] {
            assert!(has(family, name), "{family} has no case for the space {name}");
        }
    }
    for name in shipped::names() {
        assert!(has("scene", name), "no case for the scene {name}");
    }
    for section in ["1.4.1", "1.4.3", "2.4.1", "3.2.3", "3.3.3", "4.4.1", "5.1", "5.2", "5 "] {
        let named = |case: &Case| {
            case.family == "book" && case.name.split('/').nth(2).is_some_and(|what| what.starts_with(section))
        };
        assert!(cases.iter().any(named), "no formula of the book's section {section}");
    }
}

#[test]
fn stability_passes_on_the_cpu() {
    let mut bench = Bench::new(&[On::Cpu]).expect("the cpu is there");
    assert_none_fails(&run(&stability::cases(), &mut bench, |_, _, _| ()));
}

/// Software devices compile for seconds before the first picture of each space: there, pictures of one space of each kind of
/// geometry; the command draws them all.
fn quick(case: &Case) -> bool {
    !case.on.contains(&On::Rt) || ["torus", "poincare", "nil-heisenberg"].contains(&case.subject.as_str())
}

#[test]
fn stability_passes_on_compute() {
    let Some(gpu) = support::gpu() else { return };
    let mut bench = Bench::default();
    bench.add(On::Compute, &gpu).expect("the device works");
    assert_none_fails(&run(&some(quick), &mut bench, |_, _, _| ()));
}

#[test]
fn stability_passes_on_rt() {
    let Some(gpu) = support::rt_gpu() else { return };
    let mut bench = Bench::default();
    bench.add(On::Rt, &gpu).expect("the device works");
    assert_none_fails(&run(&some(quick), &mut bench, |_, _, _| ()));
}

/// An error in any reading of any family fails, and so does a result that is no number.
#[test]
fn stability_spoiled_results_are_caught() {
    let mut bench = Bench::new(&[On::Cpu]).expect("the cpu is there");
    // The first of each family is enough, for each is judged alike.
    let mut seen = BTreeSet::new();
    let mut firsts = stability::cases();
    firsts.retain(|case| case.on.contains(&On::Cpu) && seen.insert(case.family));
    assert!(firsts.len() >= 10);
    let sound = run(&firsts, &mut bench, |_, _, _| ());
    assert_none_fails(&sound);
    for spoiled in [f64::NAN, f64::INFINITY] {
        let lines = run(&firsts, &mut bench, |_, _, reading| reading.error = spoiled);
        assert!(lines.iter().all(|line| line.verdict == Verdict::Fail));
    }
    let beyond = |_: &Case, _: On, reading: &mut Reading| {
        let most = reading.accepted.map_or(reading.limit, |(limit, _)| limit);
        reading.error = 1.01 * most + f64::MIN_POSITIVE;
    };
    assert!(run(&firsts, &mut bench, beyond).iter().all(|line| line.verdict == Verdict::Fail));
}

/// A case in which the book's formula passes shows nothing, and fails.
#[test]
fn stability_book_cases_need_a_book_that_fails() {
    let mut bench = Bench::new(&[On::Cpu]).expect("the cpu is there");
    let book = some(|case| case.family == "book");
    assert!(book.len() >= 16, "{} formulas", book.len());
    let lines = run(&book, &mut bench, |_, _, _| ());
    assert!(lines.iter().all(|line| line.printed_error.is_some_and(|error| error > line.limit)), "{lines:?}");
    let right = run(&book, &mut bench, |_, _, reading| reading.printed = Some(0.0));
    assert!(right.iter().all(|line| line.verdict == Verdict::Fail));
}

/// An accepted limit is listed as such, with its number and its reason.
#[test]
fn stability_accepted_limits_are_listed() {
    let mut bench = Bench::new(&[On::Cpu]).expect("the cpu is there");
    let cases = some(|case| case.name == "edge/e3/no direction");
    let spoil = |_: &Case, _: On, reading: &mut Reading| {
        reading.error = 2.0;
        reading.accepted = Some((3.0, "for this test"));
    };
    let lines = run(&cases, &mut bench, spoil);
    assert_eq!(lines[0].verdict, Verdict::Accepted);
    assert_eq!((lines[0].accepted_limit, lines[0].reason.as_deref()), (Some(3.0), Some("for this test")));
}

fn holonomy(args: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_holonomy")).args(args).output().expect("the binary starts");
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn stability_command_reports_as_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("report.json");
    let file = file.to_str().expect("a name");
    let (code, out, _) = holonomy(&["stability", "--backend", "cpu", "--filter", "book/nil", "--json", "-o", file]);
    assert_eq!(code, Some(0));
    let report: serde_json::Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!(report["failed"], 0);
    let readings = report["readings"].as_array().expect("a list");
    assert!(readings.len() >= 4);
    for reading in readings {
        assert!(reading["name"].as_str().is_some_and(|name| name.starts_with("book/nil")));
        assert_eq!(reading["backend"], "cpu");
        assert!(reading["error"].is_number() && reading["floor"].is_number() && reading["limit"].is_number());
        assert_eq!(reading["verdict"], "pass");
    }
    let written: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(file).expect("the file is there")).expect("JSON");
    assert_eq!(written, report);
}

#[test]
fn stability_command_fails_with_code_2_and_refuses_with_1() {
    let (code, _, error) = holonomy(&["stability", "--filter", "no such case"]);
    assert_eq!(code, Some(1));
    assert!(error.contains("no case has this in its name"), "{error}");
    // Pictures of rt alone, of a family that has none.
    let (code, out, error) = holonomy(&["stability", "--backend", "cpu", "--filter", "edge/e3", "--spoil", "1e9"]);
    assert_eq!(code, Some(2), "{out}{error}");
    assert!(error.contains("readings fail, the first: edge/e3/"), "{error}");
    assert_eq!(error.lines().count(), 1);
    assert!(out.contains("FAIL"));
}
