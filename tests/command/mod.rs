//! Runs the program in a folder of its own, as its users do, and judges how it ended.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use tempfile::TempDir;

/// An empty folder, gone in the end. The program runs in it, so names of files are short.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path().join(name), bytes).expect(name);
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// All files, with the folders that they lie in.
    pub fn files(&self) -> BTreeMap<String, Vec<u8>> {
        let mut files = BTreeMap::new();
        collect(self.path(), "", &mut files);
        files
    }

    /// The program with its arguments, which are separated by spaces.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_relume"));
        command.current_dir(self.path());
        command.args(arguments.split_whitespace());
        command
    }

    /// Exit code, stdout and stderr; a panic is never right.
    fn run(&self, arguments: &str) -> (Option<i32>, Vec<u8>, String) {
        let output = self.command(arguments).output().expect("relume starts");
        let stderr = String::from_utf8(output.stderr).expect("UTF-8 on stderr");
        assert!(!stderr.contains("panicked"), "{arguments}: {stderr}");
        (output.status.code(), output.stdout, stderr)
    }

    /// Runs the program, which must succeed; returns stdout and stderr.
    pub fn told(&self, arguments: &str) -> (Vec<u8>, String) {
        let (code, stdout, stderr) = self.run(arguments);
        assert_eq!(code, Some(0), "{arguments}: {stderr}");
        (stdout, stderr)
    }

    /// Runs the program, which must succeed; returns stdout.
    pub fn done(&self, arguments: &str) -> Vec<u8> {
        self.told(arguments).0
    }

    /// Runs the program with `--json`: stdout must be one object, and stderr for people.
    pub fn json(&self, arguments: &str) -> Value {
        let (stdout, stderr) = self.told(&format!("{arguments} --json"));
        assert!(!stderr.trim_start().starts_with('{'), "{stderr}");
        one_object(&stdout)
    }

    /// Runs the program, which must refuse its input: exit 1, one line on stderr that is returned,
    /// nothing on stdout, and no file made, changed or left behind.
    pub fn refused(&self, arguments: &str) -> String {
        let before = self.files();
        let (code, stdout, stderr) = self.run(arguments);
        assert_eq!(code, Some(1), "{arguments}: {stderr}");
        assert!(stdout.is_empty(), "{arguments}: wrote to stdout");
        let line = stderr.strip_suffix('\n').expect("a whole line");
        assert!(!line.contains('\n'), "{arguments}: {stderr}");
        assert!(line.starts_with("relume: "), "{arguments}: {line}");
        assert!(self.files() == before, "{arguments}: touched files");
        line.to_owned()
    }

    /// Runs the program, which must find itself wrongly used: exit 2, nothing done.
    pub fn misused(&self, arguments: &str) -> String {
        let before = self.files();
        let (code, stdout, stderr) = self.run(arguments);
        assert_eq!(code, Some(2), "{arguments}: {stderr}");
        assert!(stdout.is_empty(), "{arguments}: wrote to stdout");
        assert!(stderr.starts_with("error: "), "{arguments}: {stderr}");
        assert!(self.files() == before, "{arguments}: touched files");
        stderr
    }
}

fn collect(folder: &Path, prefix: &str, files: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().and_then(|name| name.to_str());
        let name = format!("{prefix}{}", name.expect("a UTF-8 name"));
        if path.is_dir() {
            collect(&path, &format!("{name}/"), files);
        } else {
            files.insert(name, fs::read(&path).expect("a file"));
        }
    }
}

/// The one JSON object that `stdout` is, and nothing besides.
pub fn one_object(stdout: &[u8]) -> Value {
    let value: Value = serde_json::from_slice(stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(stdout)));
    assert!(value.is_object(), "{value}");
    value
}
