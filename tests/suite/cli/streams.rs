//! Pipes that are closed, and what is written where.

use super::program::{Place, SMALL};
use std::{
    io::{BufRead, BufReader, Write},
    process::{Child, Stdio},
};

const CASE: &[u8] = b"{\"geometry\":\"e3\",\"from\":[0,0,0],\"direction\":[0,0,1],\"length\":1}\n";

fn start_batch(place: &Place) -> Child {
    let mut command = place.command(&["geodesic", "--batch", "-"]);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("a start")
}

/// A reader that goes away after some lines; the program has more to say than pipes hold.
#[test]
fn stream_closed_by_its_reader_is_success() {
    let place = Place::new();
    for lines_read in [0, 1, 1000] {
        let mut child = start_batch(&place);
        let mut stdin = child.stdin.take().expect("a pipe");
        let mut stdout = BufReader::new(child.stdout.take().expect("a pipe"));
        std::thread::scope(|scope| {
            scope.spawn(move || {
                // Written until the program has gone, which is no error here either.
                let many = CASE.repeat(1000);
                (0..100).take_while(|_| stdin.write_all(&many).is_ok()).count()
            });
            let mut line = String::new();
            for _ in 0..lines_read {
                line.clear();
                stdout.read_line(&mut line).expect("a line");
                assert_eq!(line, "{\"direction\":[0.0,0.0,1.0],\"point\":[0.0,0.0,1.0]}\n");
            }
            drop(stdout);
            let output = child.wait_with_output().expect("an end");
            assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]), "{lines_read}");
        });
    }
}

/// Output that still waits in the program when the reader has gone.
#[test]
fn stream_closed_before_the_last_lines_is_success() {
    let place = Place::new();
    let mut child = start_batch(&place);
    drop(child.stdout.take());
    child.stdin.take().expect("a pipe").write_all(CASE).expect("a case");
    let output = child.wait_with_output().expect("an end");
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
    for args in [&["devices"][..], &["check", "torus"], &["--help"], &["transport", "torus", "--pixel", "1,1"]] {
        let mut child = place.command(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("a start");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("an end");
        assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]), "{args:?}");
    }
}

/// The sister: an output that takes nothing although its reader is there is a failure.
#[test]
#[cfg(target_os = "linux")]
fn stream_that_is_full_is_a_failure() {
    let place = Place::new();
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").expect("a device");
    place.write("cases.jsonl", CASE);
    for args in [&["geodesic", "--batch", "cases.jsonl"][..], &["check", "torus"]] {
        let output = place.command(args).stdout(full()).output().expect("a run");
        assert_eq!(output.status.code(), Some(2));
        let line = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(line.starts_with("holonomy: standard output: ") && line.lines().count() == 1, "{line}");
    }
}

/// A closed stderr changes no exit code.
#[test]
fn stream_of_errors_may_be_closed() {
    let place = Place::new();
    for (args, code) in [(SMALL, 0), (&["render", "no.toml", "-o", "out.png"][..], 1)] {
        let mut child = place.command(args).stderr(Stdio::piped()).stdin(Stdio::piped()).spawn().expect("a start");
        drop(child.stderr.take());
        assert_eq!(child.wait().expect("an end").code(), Some(code), "{args:?}");
    }
}

#[test]
fn stream_of_results_is_empty_for_pictures() {
    let run = Place::new().run(SMALL);
    assert_eq!((run.out.as_str(), run.err.as_str(), run.code), ("", "backend cpu: asked for\n", Some(0)));
}
