//! Options and outputs that are refused, word by word.

use super::program::{Place, SMALL};
use std::fs;

/// The refusal of a picture of the torus with further options.
fn refused(options: &[&str]) -> String {
    Place::new().refusal(&[&["render", "torus", "-o", "out.png"], options].concat())
}

#[test]
fn option_values_out_of_range_are_refused() {
    let size = "expected WIDTHxHEIGHT with sides from 1 to 16384, such as 1024x768";
    for value in ["0x10", "10x0", "99999x99999", "12", "12x", "x12", "-3x4", "1e3x4", "3x4x5", "nan", ""] {
        let line = refused(&[&format!("--size={value}")]);
        // An empty value gets words of the parser.
        assert!(value.is_empty() || line == format!("invalid value '{value}' for '--size <WxH>': {size}"), "{line}");
    }
    for value in ["0", "999999999", "100001"] {
        let line = format!("invalid value '{value}' for '--bounces <N>': {value} is not in 1..=100000");
        assert_eq!(refused(&["--bounces", value]), line);
    }
    assert_eq!(
        refused(&["--bounces", "many"]),
        "invalid value 'many' for '--bounces <N>': invalid digit found in string"
    );
    assert_eq!(refused(&["--samples", "0"]), "invalid value '0' for '--samples <N>': 0 is not in 1..=65536");
    for (value, why) in [("nan", "finite"), ("inf", "finite"), ("0", "positive"), ("-1", "positive")] {
        let line = refused(&[&format!("--tolerance={value}")]);
        assert_eq!(line, format!("invalid value '{value}' for '--tolerance <E>': the number must be {why}"));
    }
    assert_eq!(
        refused(&["--samples", "4", "--shading", "distance"]),
        "--samples 4: raw values have no meaningful mean, use 1"
    );
}

#[test]
fn options_that_are_unknown_name_the_nearest() {
    assert_eq!(
        refused(&["--siz", "8x8"]),
        "unexpected argument '--siz' found; tip: a similar argument exists: '--size'"
    );
    let line = refused(&["--frobnicate"]);
    assert!(line.starts_with("unexpected argument '--frobnicate' found"), "{line}");
    let line = refused(&["--backend", "rtx"]);
    assert!(line.starts_with("invalid value 'rtx' for '--backend <BACKEND>' [possible values: auto, "), "{line}");
    let line = refused(&["--shading", "distanc"]);
    assert!(
        line.starts_with("invalid value 'distanc' for '--shading <NAME>' [possible values: riemannian, "),
        "{line}"
    );
    assert!(line.ends_with("; tip: a similar value exists: 'distance'"), "{line}");
    let line = refused(&["--integrator", "magic"]);
    assert!(line.starts_with("invalid value 'magic' for '--integrator <INTEGRATOR>' [possible values: "), "{line}");
}

#[test]
fn commands_that_are_missing_or_unknown_are_refused() {
    let place = Place::new();
    let line = place.refusal(&[]);
    assert!(line.starts_with("a command is missing: render, "), "{line}");
    assert!(line.ends_with(" (--help explains them)"), "{line}");
    assert_eq!(
        place.refusal(&["rendr"]),
        "unrecognized subcommand 'rendr'; tip: a similar subcommand exists: 'render'"
    );
    assert_eq!(
        place.refusal(&["render"]),
        "the following required arguments were not provided: --output <FILE>; <SCENE>"
    );
    assert_eq!(
        place.refusal(&["render", "torus"]),
        "the following required arguments were not provided: --output <FILE>"
    );
}

#[test]
fn outputs_of_unknown_kind_are_refused() {
    let place = Place::new();
    for name in ["out.jpg", "out", "out.png.", ".png", "png", "out.toml"] {
        let line = place.refusal(&["render", "torus", "-o", name]);
        assert_eq!(line, format!("{name}: the file name must end in .png or .exr"));
    }
    place.run(&["render", "torus", "-o", "OUT.PNG", "--size", "2x2", "--backend", "cpu"]).done();
    assert!(place.has("OUT.PNG"));
}

#[test]
fn outputs_that_cannot_be_written_are_refused() {
    let place = Place::new();
    let refusal = |name| place.refusal(&["render", "torus", "-o", name]);
    assert_eq!(refusal("no/out.png"), "no/out.png: there is no folder no");
    fs::create_dir(place.path().join("dir.png")).expect("a folder");
    assert_eq!(refusal("dir.png"), "dir.png: is a folder");
    place.write("plain", "");
    assert_eq!(refusal("plain/out.png"), "plain/out.png: there is no folder plain");
    let refusal = |name| place.refusal(&["render", "torus", "-o", "out.png", "--stats", name]);
    assert_eq!(refusal("no/stats.json"), "no/stats.json: there is no folder no");
    assert_eq!(refusal("dir.png"), "dir.png: is a folder");
}

#[test]
fn outputs_that_are_protected_are_refused() {
    let place = Place::new();
    let old = place.write("out.png", "old");
    let mut permissions = old.metadata().expect("a file").permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&old, permissions).expect("a change");
    assert_eq!(place.refusal(SMALL), "out.png: is read-only");
    assert_eq!(place.read("out.png"), b"old");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        assert_eq!(
            place.refusal(&["render", "torus", "-o", "other.png", "--stats", "/dev/null"]),
            "/dev/null: is not a plain file"
        );
        // The sister: with permission the old picture is replaced.
        fs::set_permissions(&old, fs::Permissions::from_mode(0o644)).expect("a change");
        place.run(SMALL).done();
        assert!(place.read("out.png").starts_with(b"\x89PNG"));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn outputs_into_a_closed_folder_are_refused() {
    use std::os::unix::fs::PermissionsExt;
    let place = Place::new();
    // Nobody can make files there, whatever their rights.
    let line = place.refusal(&["render", "torus", "-o", "/proc/out.png"]);
    assert!(line.starts_with("/proc/out.png: cannot write into its folder: "), "{line}");
    let closed = place.path().join("closed");
    fs::create_dir(&closed).expect("a folder");
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o555)).expect("a change");
    // Root may write everywhere.
    if fs::write(closed.join("probe"), "").is_err() {
        let line = place.refusal(&["render", "torus", "-o", "closed/out.png"]);
        assert_eq!(line, "closed/out.png: cannot write into its folder: permission denied");
    }
    fs::set_permissions(&closed, fs::Permissions::from_mode(0o755)).expect("a change");
}
