//! Running the binary, and what a refusal must look like.

use serde_json::Value;
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};
use tempfile::TempDir;

/// How the program ended and what it said.
#[derive(Clone, Debug)]
pub struct Run {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

impl Run {
    fn new(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        Self { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    /// Standard output of a run that must have gone well.
    pub fn done(self) -> String {
        assert_eq!(self.code, Some(0), "{self:?}");
        self.out
    }

    /// Standard output as one JSON value.
    pub fn json(self) -> Value {
        serde_json::from_str(&self.done()).expect("JSON")
    }

    /// Standard output as one JSON value per line.
    pub fn json_lines(self) -> Vec<Value> {
        self.done().lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }

    /// The line of an error with this exit code: nothing on stdout, and one line on stderr.
    pub fn error(&self, code: i32) -> Result<&str, String> {
        if self.code != Some(code) {
            return Err(format!("exit code {code} expected: {self:?}"));
        }
        if !self.out.is_empty() {
            return Err(format!("nothing on stdout expected: {self:?}"));
        }
        let line = self.err.strip_suffix('\n').filter(|line| !line.contains('\n'));
        line.and_then(|line| line.strip_prefix("holonomy: ")).ok_or_else(|| format!("one line expected: {self:?}"))
    }
}

/// A folder in which the program runs.
pub struct Place(TempDir);

impl Place {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file, and the folders on the way to it.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(&path, content).expect("a file");
        path
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn has(&self, name: &str) -> bool {
        self.path().join(name).exists()
    }

    /// The program, about to run here.
    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_holonomy"));
        command.args(args).current_dir(self.path()).stdin(Stdio::null());
        command.env_remove("HOLONOMY_VALIDATION").env("HOLONOMY_CACHE", "off");
        command
    }

    pub fn run(&self, args: &[&str]) -> Run {
        Run::new(self.command(args).output().expect("a run"))
    }

    /// A run with further environment variables.
    pub fn run_with(&self, variables: &[(&str, &str)], args: &[&str]) -> Run {
        Run::new(self.command(args).envs(variables.iter().copied()).output().expect("a run"))
    }

    /// A run that reads `input`.
    pub fn feed(&self, args: &[&str], input: &[u8]) -> Run {
        let mut command = self.command(args);
        let mut child =
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("a start");
        let mut stdin = child.stdin.take().expect("a pipe");
        // From a thread: the program answers before it has read everything.
        std::thread::scope(|scope| {
            scope.spawn(move || stdin.write_all(input));
            Run::new(child.wait_with_output().expect("a run"))
        })
    }

    /// All files here with their sizes, in order.
    pub fn files(&self) -> Vec<(PathBuf, u64)> {
        let mut folders = vec![self.path().to_owned()];
        let mut files = Vec::new();
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).expect("a folder") {
                let entry = entry.expect("an entry");
                if entry.file_type().expect("a type").is_dir() {
                    folders.push(entry.path());
                }
                files.push((entry.path(), entry.metadata().map_or(0, |m| m.len())));
            }
        }
        files.sort();
        files
    }

    /// The line with which these arguments are refused; no file may come, go or change its size.
    pub fn refusal(&self, args: &[&str]) -> String {
        self.try_refusal(args).unwrap_or_else(|e| panic!("{args:?}: {e}"))
    }

    fn try_refusal(&self, args: &[&str]) -> Result<String, String> {
        let before = self.files();
        let run = self.run(args);
        let line = run.error(1)?.to_owned();
        let after = self.files();
        if before == after { Ok(line) } else { Err(format!("{line}: {before:?} became {after:?}")) }
    }

    /// The refusal of a scene that is written here as `scene.toml`.
    pub fn refused_scene(&self, text: &str) -> String {
        self.write("scene.toml", text);
        self.refusal(&["render", "scene.toml", "-o", "out.png", "--stats", "out.json", "--size", "8x8"])
    }
}

/// The smallest picture on the cpu.
pub const SMALL: &[&str] = &["render", "torus", "-o", "out.png", "--size", "4x4", "--backend", "cpu"];

#[test]
fn error_check_notices_other_ends() {
    let good = Run { code: Some(1), out: String::new(), err: "holonomy: no\n".to_owned() };
    assert_eq!(good.error(1), Ok("no"));
    assert!(good.error(2).is_err());
    for spoilt in [
        Run { code: Some(101), ..good.clone() },
        Run { code: None, ..good.clone() },
        Run { out: "{}\n".to_owned(), ..good.clone() },
        Run { err: "backend cpu: asked for\nholonomy: no\n".to_owned(), ..good.clone() },
        Run { err: "holonomy: no".to_owned(), ..good.clone() },
        Run { err: "no\n".to_owned(), ..good.clone() },
        Run { err: String::new(), ..good.clone() },
    ] {
        assert!(spoilt.error(1).is_err(), "{spoilt:?}");
    }
}

#[test]
fn refusal_check_notices_files_and_success() {
    let place = Place::new();
    assert!(place.try_refusal(SMALL).is_err_and(|e| e.starts_with("exit code 1 expected")));
    assert!(place.has("out.png"));
    let before = place.files();
    place.write(".holonomy-x.tmp", "");
    assert_ne!(place.files(), before);
    place.write("out.png", "shorter");
    assert_ne!(place.files(), before);
}
