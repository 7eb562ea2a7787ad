//! `holonomy vr` on Monado, a real OpenXR runtime without a headset, which `tools/setup --tests` puts into `target/monado`.
//!
//! Monado's client library wants a newer C library than Debian 12 has, so the program runs by the dynamic linker that came
//! with it (`target/monado/run`), with the system's own drivers. Monado has no compositor here: the images of the eyes are
//! read back by the program itself.

use crate::support::{Random, gpu_turn, rt_turn, skip};
use glam::{DQuat, DVec3};
use serde_json::Value;
use std::{
    fs,
    io::{Read, Write},
    net::TcpStream,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// A machine at work is slow: this only ends tests that hang.
const PATIENCE: Duration = Duration::from_secs(240);

/// Port of Monado's remote driver, which cannot be chosen.
const REMOTE_PORT: u16 = 4242;

/// The folder with Monado, or none where the test is skipped.
fn folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/monado");
    if folder.join("run").is_file() {
        return Some(folder);
    }
    skip("xr", "no Monado in target/monado: tools/setup --tests puts it there");
    None
}

/// A service of Monado with a place of its own. Its end is the end of the service.
struct Monado {
    folder: PathBuf,
    place: TempDir,
    service: Child,
}

impl Monado {
    fn start(variables: &[(&str, &str)]) -> Option<Self> {
        let folder = folder()?;
        let place = tempfile::tempdir().expect("a folder");
        fs::set_permissions(place.path(), fs::Permissions::from_mode(0o700)).expect("private");
        let log = fs::File::create(place.path().join("log")).expect("a log");
        let mut command = Command::new(folder.join("run"));
        command
            .arg(folder.join("monado-service"))
            .env_clear()
            .env("PATH", "/usr/bin:/bin")
            .env("HOME", place.path())
            .env("XDG_RUNTIME_DIR", place.path())
            .env("XRT_COMPOSITOR_NULL", "1")
            .env("XRT_NO_STDIN", "1")
            .envs(drivers())
            .envs(variables.iter().copied())
            .stdin(Stdio::null())
            .stdout(log.try_clone().expect("a log"))
            .stderr(log);
        let service = command.spawn().expect("Monado starts");
        let mut monado = Self { folder, place, service };
        let since = Instant::now();
        while !monado.place.path().join("monado_comp_ipc").exists() {
            assert!(since.elapsed() < PATIENCE, "Monado does not come up: {}", monado.log());
            assert!(monado.service.try_wait().expect("a child").is_none(), "Monado has gone: {}", monado.log());
            thread::sleep(Duration::from_millis(20));
        }
        Some(monado)
    }

    /// With its simulated headset and two simulated controllers.
    fn simulated() -> Option<Self> {
        Self::start(&[("SIMULATED_ENABLE", "1"), ("SIMULATED_LEFT", "simple"), ("SIMULATED_RIGHT", "simple")])
    }

    fn log(&self) -> String {
        fs::read_to_string(self.place.path().join("log")).unwrap_or_default()
    }

    /// A file or folder in this service's place.
    fn path(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }

    /// The program, under validation, as a child whose words are kept.
    fn program(&self, args: &[&str]) -> Program {
        program(&self.folder, self.place.path(), args)
    }

    fn run(&self, args: &[&str]) -> Run {
        self.program(args).finish()
    }

    fn signal(&self, name: &str) {
        let sent = Command::new("kill").args([name, &self.service.id().to_string()]).status().expect("kill");
        assert!(sent.success());
    }
}

impl Drop for Monado {
    fn drop(&mut self) {
        let _ = self.service.kill();
        let _ = self.service.wait();
    }
}

/// The driver that `tools/setup --tests` has put in place, for both sides: they must share a device.
fn drivers() -> Option<(&'static str, PathBuf)> {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/vulkan/lavapipe.json");
    manifest.is_file().then_some(("VK_DRIVER_FILES", manifest))
}

/// The program while it runs.
struct Program {
    child: Child,
    place: PathBuf,
}

fn program(folder: &Path, place: &Path, args: &[&str]) -> Program {
    let mut command = Command::new(folder.join("run"));
    command
        .arg(env!("CARGO_BIN_EXE_holonomy"))
        .args(args)
        .current_dir(place)
        .env("XDG_RUNTIME_DIR", place)
        .env("XR_RUNTIME_JSON", folder.join("runtime.json"))
        .env("HOLONOMY_VALIDATION", "sync")
        .env_remove("HOLONOMY_DEVICE")
        .envs(drivers())
        .stdin(Stdio::null())
        .stdout(fs::File::create(place.join("out")).expect("a file"))
        .stderr(fs::File::create(place.join("err")).expect("a file"));
    Program { child: command.spawn().expect("the program starts"), place: place.to_owned() }
}

impl Program {
    fn words(&self) -> String {
        fs::read_to_string(self.place.join("err")).unwrap_or_default()
    }

    /// Waits until it is in a session.
    fn in_session(&mut self) {
        let since = Instant::now();
        while !self.words().contains("pixels for each eye") {
            assert!(since.elapsed() < PATIENCE && self.is_running(), "no session: {}", self.words());
            thread::sleep(Duration::from_millis(20));
        }
    }

    fn is_running(&mut self) -> bool {
        self.child.try_wait().expect("a child").is_none()
    }

    /// Waits for its end.
    fn finish(mut self) -> Run {
        let since = Instant::now();
        while self.is_running() {
            if since.elapsed() > PATIENCE {
                let _ = self.child.kill();
                panic!("the program hangs: {}", self.words());
            }
            thread::sleep(Duration::from_millis(20));
        }
        let status = self.child.wait().expect("a child");
        let output = Output { status, stdout: Vec::new(), stderr: self.words().into_bytes() };
        Run { output, place: self.place.clone() }
    }
}

/// A run that is over.
struct Run {
    output: Output,
    place: PathBuf,
}

impl Run {
    /// What the program itself has said last; the runtime talks too.
    fn line(&self) -> String {
        let words = String::from_utf8_lossy(&self.output.stderr).into_owned();
        words.lines().filter_map(|line| line.strip_prefix("holonomy: ")).next_back().unwrap_or_default().to_owned()
    }

    fn done(self) -> Self {
        let words = String::from_utf8_lossy(&self.output.stderr);
        assert_eq!(self.output.status.code(), Some(0), "{words}");
        self
    }

    fn json(&self, name: &str) -> Value {
        let text = fs::read(self.place.join(name)).expect("the file is there");
        serde_json::from_slice(&text).expect("it is JSON")
    }
}

/// Sixty frames with two controllers.
fn sixty_frames(monado: &Monado, backend: &str) {
    // Wide enough to see a hand in each eye, and done in seconds on a machine without a device.
    let args = ["vr", "torus", "--frames", "60", "--backend", backend, "--resolution-scale", "0.05"];
    let run = monado.run(&[&args[..], &["--bounces", "3", "--stats", "stats.json"]].concat()).done();
    let stats = run.json("stats.json");
    assert_eq!(stats["frames"], 60);
    assert_eq!(stats["backend"], backend);
    assert_eq!(stats["validation_messages"], serde_json::json!([]));
    assert_eq!(stats["hands_tracked"], serde_json::json!([60, 60]));
    assert_eq!(stats["odd_state_changes"], 0);
    assert_eq!(stats["one_dispatch"], true);
    assert_eq!(stats["depth"], true);
    let states = ["idle", "ready", "synchronized", "visible", "focused", "visible", "synchronized", "stopping", "idle"];
    let expected: Vec<&str> = states.into_iter().chain(["exiting"]).collect();
    assert_eq!(stats["session_states"], serde_json::json!(expected));
    // Monado's simulated headset hides the corners.
    assert!(stats["rays_per_frame"].as_u64() < stats["pixels_per_frame"].as_u64());
    assert!(stats["pose_to_submit_ms"]["p50"].as_f64().is_some_and(|time| time > 0.0));
    assert!(stats["share_not_tracing"].as_f64().is_some_and(|share| (0.0..1.0).contains(&share)));
    assert!(
        fs::read_dir(monado.place.path())
            .expect("a folder")
            .all(|file| { !file.expect("a file").file_name().to_string_lossy().ends_with(".tmp") })
    );
}

#[test]
fn monado_sixty_frames_on_compute() {
    let Some((_turn, _)) = gpu_turn() else { return };
    if let Some(monado) = Monado::simulated() {
        sixty_frames(&monado, "compute");
    }
}

#[test]
fn monado_sixty_frames_on_rt() {
    let Some((_turn, _)) = rt_turn() else { return };
    if let Some(monado) = Monado::simulated() {
        sixty_frames(&monado, "rt");
    }
}

/// What the remote driver is told: a head with two eyes and two hands.
#[derive(Clone, Copy)]
struct Told {
    head: (DVec3, DQuat),
    /// Angles left, right, up, down, and the place of each eye in the head.
    eyes: [([f64; 4], DVec3, DQuat); 2],
    hands: [(DVec3, DQuat); 2],
    trigger: [f64; 2],
    stick: [[f64; 2]; 2],
    button: bool,
}

impl Told {
    /// The packet of Monado 25's remote driver: a mark, the head, the left and the right controller, 376 bytes.
    fn packet(&self) -> Vec<u8> {
        let mut packet = b"mndrmt3\0".to_vec();
        let numbers = |packet: &mut Vec<u8>, numbers: &[f64]| {
            numbers.iter().for_each(|number| packet.extend((*number as f32).to_le_bytes()));
        };
        let pose = |packet: &mut Vec<u8>, (place, turn): (DVec3, DQuat)| {
            numbers(packet, &turn.to_array());
            numbers(packet, &place.to_array());
        };
        for (angles, place, turn) in self.eyes {
            numbers(&mut packet, &angles);
            pose(&mut packet, (place, turn));
            packet.extend([0; 4]);
        }
        pose(&mut packet, self.head);
        packet.extend([1, 0, 0, 0]);
        for hand in 0..2 {
            pose(&mut packet, self.hands[hand]);
            // Velocities, and how far fingers are curled.
            numbers(&mut packet, &[0.0; 11]);
            let [x, y] = self.stick[hand];
            numbers(&mut packet, &[self.trigger[hand], 0.0, 0.0, x, y, 0.0, 0.0, 0.0]);
            let mut buttons = [0_u8; 16];
            // Active, the button a, the trigger's click.
            buttons[1] = 1;
            buttons[4] = self.button.into();
            buttons[8] = (self.trigger[hand] > 0.9).into();
            packet.extend(buttons);
        }
        assert_eq!(packet.len(), 376);
        packet
    }
}

/// A line to the remote driver.
struct Remote(TcpStream);

impl Remote {
    fn new() -> Self {
        let since = Instant::now();
        loop {
            match TcpStream::connect(("127.0.0.1", REMOTE_PORT)) {
                Ok(mut stream) => {
                    let mut greeting = [0; 376];
                    stream.read_exact(&mut greeting).expect("the driver's state");
                    return Self(stream);
                }
                Err(error) => assert!(since.elapsed() < PATIENCE, "no remote driver: {error}"),
            }
            thread::sleep(Duration::from_millis(50));
        }
    }

    fn tell(&mut self, told: &Told) {
        self.0.write_all(&told.packet()).expect("told");
    }
}

fn vector(value: &Value) -> DVec3 {
    let numbers: Vec<f64> = serde_json::from_value(value.clone()).expect("numbers");
    DVec3::new(numbers[0], numbers[1], numbers[2])
}

fn quaternion(value: &Value) -> DQuat {
    DQuat::from_array(serde_json::from_value(value.clone()).expect("four numbers"))
}

/// Largest difference of two pictures in any channel, where the first is not black, and how many pixels are seen.
fn difference(a: &Path, b: &Path) -> (u8, usize) {
    let [a, b] = [a, b].map(|path| image::open(path).expect("a picture").to_rgb8());
    assert_eq!(a.dimensions(), b.dimensions());
    let seen: Vec<_> = a.pixels().zip(b.pixels()).filter(|(p, _)| p.0 != [0; 3]).collect();
    let off = |p: &image::Rgb<u8>, q: &image::Rgb<u8>| (0..3).map(|i| p.0[i].abs_diff(q.0[i])).max().unwrap_or(0);
    (seen.iter().map(|(p, q)| off(p, q)).max().unwrap_or(255), seen.len())
}

/// Asymmetric and canted eyes, a head and hands that move, and buttons come out as they were told; and each eye's picture is
/// the one that `render` draws from the same place.
fn remote(monado: &Monado, backend: &str) {
    let mut remote = Remote::new();
    let cant = |angle: f64| DQuat::from_rotation_y(angle);
    let first = Told {
        head: (DVec3::new(0.1, 1.7, 0.2), DQuat::from_euler(glam::EulerRot::YXZ, 0.4, -0.2, 0.3)),
        eyes: [
            ([-0.9, 0.7, 0.8, -0.75], DVec3::new(-0.032, 0.0, 0.001), cant(0.1)),
            ([-0.7, 0.9, 0.8, -0.75], DVec3::new(0.033, 0.001, 0.0), cant(-0.1)),
        ],
        hands: [
            (DVec3::new(-0.2, 1.5, -0.4), DQuat::from_rotation_x(0.5)),
            (DVec3::new(0.3, 1.6, -0.5), DQuat::from_rotation_z(0.6)),
        ],
        trigger: [0.0, 0.0],
        stick: [[0.0; 2]; 2],
        button: false,
    };
    let args = ["vr", "torus", "--backend", backend, "--resolution-scale", "0.2", "--tracking", "reference"];
    let look = |name: &str, told: &Told, frames: &str, remote: &mut Remote| -> [Value; 2] {
        remote.tell(told);
        let saving = ["--frames", frames, "--save-eyes", name, "--unit-in-metres", "2"];
        let run = monado.run(&[&args[..], &saving].concat()).done();
        ["left", "right"].map(|eye| run.json(&format!("{name}/{eye}.json")))
    };
    let eyes = look("first", &first, "3", &mut remote);
    // The driver's floor is 1.6 metres below the origin of the runtime's local space.
    let floor = DVec3::Y * 1.6;
    for (index, eye) in eyes.iter().enumerate() {
        let room = &eye["room"];
        let (angles, place, turn) = first.eyes[index];
        let [left, right, up, down] = angles;
        let seen: [f64; 4] = serde_json::from_value(room["angles"].clone()).expect("angles");
        for (seen, told) in seen.iter().zip([left, right, down, up]) {
            assert!((seen - told).abs() < 1e-6, "{seen} for {told}");
        }
        let (head, head_turn) = first.head;
        assert!((vector(&room["head"]["position"]) - (head - floor)).length() < 1e-5);
        assert!(quaternion(&room["head"]["rotation"]).angle_between(head_turn) < 1e-3);
        let there = head - floor + head_turn * place;
        assert!((vector(&room["eye"]["position"]) - there).length() < 1e-5, "{room}");
        assert!(quaternion(&room["eye"]["rotation"]).angle_between(head_turn * turn) < 1e-3);
        for (hand, (place, _)) in first.hands.iter().enumerate() {
            assert!((vector(&room["grips"][hand]["position"]) - (*place - floor)).length() < 1e-5);
            assert!((vector(&room["aims"][hand]["position"]) - (*place - floor)).length() < 0.2);
        }
        // The picture, drawn again without a headset: 16 bits or fewer were handed over, and rounded once more.
        let name = ["left", "right"][index];
        let file = format!("first/{name}.json");
        monado.run(&["render", "torus", "--eye", &file, "--backend", backend, "-o", "again.png"]).done();
        let (off, seen) = difference(&monado.path(&format!("first/{name}.png")), &monado.path("again.png"));
        assert!(seen > 1000 && off <= 2, "{name}: {off} of 255 in {seen} pixels");
        // The spoiled sister: the other eye's picture is another one.
        let other = ["first/right.png", "first/left.png"][index];
        assert!(difference(&monado.path(other), &monado.path("again.png")).0 > 20);
    }
    // The head has moved: in flat space, its eyes have moved by as much, in units of two metres.
    let mut moved = first;
    let step = DVec3::new(0.06, -0.04, 0.08);
    moved.head.0 += step;
    moved.hands.iter_mut().for_each(|hand| hand.0 += step);
    let after = look("moved", &moved, "3", &mut remote);
    let point = |eye: &Value| vector(&eye["eye"]["point"]);
    let axes = |eye: &Value| -> [DVec3; 3] { [0, 1, 2].map(|i| vector(&eye["eye"]["axes"][i])) };
    let turn = |eye: &Value| quaternion(&eye["room"]["eye"]["rotation"]);
    for (before, after) in eyes.iter().zip(&after) {
        // The eye's own axes and its turn in the room give the room's axes in the space.
        let (own, turn) = (axes(before), turn(before).inverse());
        let in_eye = turn * step / 2.0;
        let expected = own[0] * in_eye.x + own[1] * in_eye.y + own[2] * in_eye.z;
        let way = point(after) - point(before);
        assert!((way - way.round() - expected).length() < 1e-5, "{way} for {expected}");
    }
    // A trigger pulls the player along, the stick turns him, and a button takes him back.
    let pulled = Told { trigger: [0.0, 1.0], ..first };
    let pull = look("pulled", &pulled, "4", &mut remote);
    assert_eq!(pull[0]["room"]["forward"][1], 1.0);
    // Through a face one comes back at the other end of the cube.
    let way = point(&pull[0]) - point(&eyes[0]);
    let way = way - way.round();
    let aim = quaternion(&pull[0]["room"]["aims"][1]["rotation"]) * DVec3::NEG_Z;
    let in_eye = turn(&eyes[0]).inverse() * aim;
    let own = axes(&eyes[0]);
    let wanted = own[0] * in_eye.x + own[1] * in_eye.y + own[2] * in_eye.z;
    assert!(way.length() > 1e-3 && way.normalize().dot(wanted) > 0.9999, "{way} along {wanted}");
    let turned = Told { stick: [[0.0; 2], [1.0, 0.0]], ..first };
    let turned = look("turned", &turned, "12", &mut remote);
    assert!(axes(&turned[0])[2].angle_between(axes(&eyes[0])[2]) > 1e-2, "the stick turns");
    let back = Told { button: true, ..first };
    let back = look("back", &back, "3", &mut remote);
    assert!(vector(&back[0]["observer"]["point"]).distance(vector(&eyes[0]["observer"]["point"])) > 1e-3);
    assert_eq!(back[0]["room"]["recentre"], true);
}

#[test]
fn monado_remote_on_compute() {
    let Some((_turn, _)) = gpu_turn() else { return };
    if let Some(monado) = Monado::start(&[("P_OVERRIDE_ACTIVE_CONFIG", "remote")]) {
        remote(&monado, "compute");
    }
}

/// Whatever is chosen is drawn, and the statistics say what was.
#[test]
fn monado_options_are_followed() {
    let Some((_turn, _)) = gpu_turn() else { return };
    let Some(monado) = Monado::simulated() else { return };
    let base = ["vr", "torus", "--backend", "compute", "--bounces", "4", "--stats", "stats.json", "--bare"];
    let run = |more: &[&str]| monado.run(&[&base[..], more].concat()).done().json("stats.json");
    let plain = run(&["--frames", "3", "--resolution-scale", "0.2"]);
    let thin = run(&["--frames", "3", "--resolution-scale", "0.2", "--foveation", "10"]);
    let (all, few) = (plain["rays_per_frame"].as_u64(), thin["rays_per_frame"].as_u64());
    assert!(few < all.map(|all| all / 2), "{few:?} of {all:?}");
    let apart = run(&["--frames", "2", "--resolution-scale", "0.1", "--apart"]);
    assert_eq!(apart["one_dispatch"], false);
    // A rate that no machine holds: bounces and pixels are given up, and the statistics say so.
    let held = run(&["--frames", "12", "--resolution-scale", "0.3", "--hold-fps", "1000000"]);
    let last = |value: &Value| value.as_array().and_then(|all| all.last().cloned());
    assert_eq!(last(&held["bounces"]), Some(serde_json::json!(2)));
    let side = |value: &Value| value[0].as_u64().expect("a width");
    let (first, last) = (side(&held["sizes"][0]), side(&last(&held["sizes"]).expect("a size")));
    assert_eq!(last, (first as f64 * 0.5).round() as u64);
    for stats in [&plain, &thin, &apart, &held] {
        assert_eq!(stats["validation_messages"], serde_json::json!([]));
    }
}

/// The runtime is killed at random moments: before, while and after a session is made, and in the middle of frames. The
/// program always ends by itself, with one line and the exit code of a failure, and leaves nothing half done.
#[test]
fn monado_killed_at_random_moments() {
    let Some((_turn, _)) = gpu_turn() else { return };
    if folder().is_none() {
        return;
    }
    let mut random = Random(2026);
    let mut ends = Vec::new();
    for round in 0..20 {
        let Some(monado) = Monado::simulated() else { return };
        let args = ["vr", "torus", "--backend", "compute", "--resolution-scale", "0.05", "--bounces", "2", "--bare"];
        let mut program = monado.program(&[&args[..], &["--stats", "stats.json", "--save-eyes", "eyes"]].concat());
        // Three of four in a session.
        if round % 4 != 0 {
            program.in_session();
        }
        thread::sleep(Duration::from_secs_f64(random.within(0.0, 1.0)));
        assert!(program.is_running(), "it ran until the runtime was killed: {}", program.words());
        monado.signal("-KILL");
        let run = program.finish();
        let line = run.line();
        assert_eq!(run.output.status.code(), Some(2), "round {round}: {line}");
        assert!(!line.is_empty() && !line.contains("panicked"), "round {round}: {line:?}");
        // What is there is whole.
        for file in fs::read_dir(monado.place.path()).expect("a folder") {
            let name = file.expect("a file").file_name().to_string_lossy().into_owned();
            assert!(!name.ends_with(".tmp"), "round {round} leaves {name}");
        }
        if monado.path("stats.json").exists() {
            assert!(run.json("stats.json")["ended"].is_string());
        }
        ends.push(line);
    }
    ends.sort();
    ends.dedup();
    eprintln!("killed: {ends:#?}");
    let in_frames = |line: &String| line.starts_with("the OpenXR runtime is gone after") && !line.contains(" 0 frames");
    assert!(ends.iter().any(in_frames), "some are killed between frames: {ends:?}");
}

/// A runtime that stops answering, and one that is not there.
#[test]
fn monado_that_hangs_or_is_missing() {
    let Some((_turn, _)) = gpu_turn() else { return };
    let Some(monado) = Monado::simulated() else { return };
    let args = ["vr", "torus", "--backend", "compute", "--resolution-scale", "0.05", "--bounces", "2"];
    let mut program = monado.program(&args);
    program.in_session();
    thread::sleep(Duration::from_secs(2));
    monado.signal("-STOP");
    let run = program.finish();
    monado.signal("-CONT");
    assert_eq!(run.output.status.code(), Some(2), "{}", run.line());
    assert!(run.line().contains("the OpenXR runtime has not answered for nearly 5 s"), "{}", run.line());
    let nobody = tempfile::tempdir().expect("a folder");
    let run = program_finish(&monado.folder, nobody.path(), &args);
    assert_eq!(run.output.status.code(), Some(2));
    assert!(run.line().starts_with("no OpenXR runtime: "), "{}", run.line());
}

fn program_finish(folder: &Path, place: &Path, args: &[&str]) -> Run {
    program(folder, place, args).finish()
}
