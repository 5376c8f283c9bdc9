//! Ctrl-C: a valid file of what was reached, or none.

use std::fs;

use super::with_scene;
use crate::command::{self, Folder};

#[cfg(unix)]
#[test]
fn an_interrupted_bake_is_byte_for_byte_what_its_shots_give() {
    for method in ["gather", "rows"] {
        interrupt_until_it_counts(&format!("bake room.obj --element 0.1 --method {method}"));
    }
}

/// Interrupts a bake of 6000 elements until the signal comes between the first row and the last.
#[cfg(unix)]
fn interrupt_until_it_counts(bake: &str) {
    use std::process::{Command, Stdio};
    use std::time::Instant;

    let folder = with_scene();
    let start = Instant::now();
    let whole = folder.json(&format!("{bake} -o whole"));
    // How fast the machine is at any time does not matter: after a signal that came too early or too late, there is another.
    let mut patience = start.elapsed().mul_f32(0.6);
    for _ in 0..20 {
        let mut command = folder.command(&format!("{bake} -o part --json"));
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = command.spawn().expect("relume starts");
        std::thread::sleep(patience);
        let mut kill = Command::new("kill");
        let kill = kill.args(["-INT", &child.id().to_string()]);
        kill.status().expect("there is a `kill`");
        let output = child.wait_with_output().expect("relume ends");
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        match output.status.code() {
            Some(130) => {
                let report = command::one_object(&output.stdout);
                let shots = report["shots"].as_u64().unwrap();
                assert_eq!(report["interrupted"], true);
                assert!(shots < whole["shots"].as_u64().unwrap(), "{report}");
                let told = format!("--shots {shots} ");
                assert!(stderr.contains(&told), "{stderr}");
                if shots > 8 {
                    folder.done(&format!("{bake} -o told --shots {shots}"));
                    let part = folder.read("part");
                    let is_told = part == folder.read("told");
                    assert!(is_told, "not what --shots {shots} gives");
                    assert!(part != folder.read("whole"));
                    assert_eq!(folder.files().len(), 3 + 3, "something is left");
                    return;
                }
                patience = patience.mul_f32(1.5);
            }
            Some(0) => patience = patience.mul_f32(0.7),
            // The signal came before anyone listened.
            None => {
                assert_eq!(folder.files().len(), 3 + 1, "something is left");
                patience = patience.mul_f32(1.5);
            }
            code => panic!("exit {code:?}: {stderr}"),
        }
        let _ = fs::remove_file(folder.path().join("part"));
    }
    panic!("never interrupted in time");
}

/// Runs the program, sends it Ctrl-C as soon as `is_time`, and waits for its end.
#[cfg(unix)]
fn interrupted(
    mut command: std::process::Command,
    is_time: impl Fn() -> bool,
) -> std::process::Output {
    use std::process::{Command, Stdio};

    let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("relume starts");
    while !is_time() && child.try_wait().expect("a child").is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let mut kill = Command::new("kill");
    let kill = kill.args(["-INT", &child.id().to_string()]);
    kill.status().expect("there is a `kill`");
    child.wait_with_output().expect("relume ends")
}

#[cfg(unix)]
#[test]
fn a_bake_that_is_interrupted_before_its_first_row_writes_nothing() {
    use std::time::{Duration, Instant};

    // The insides of 2000 closed boxes under a lamp: no light to be found in any of them.
    const CORNERS: [&str; 6] = [
        "-8 -7 -5 -6",
        "-4 -3 -1 -2",
        "-8 -7 -3 -4",
        "-6 -5 -1 -2",
        "-8 -6 -2 -4",
        "-7 -5 -1 -3",
    ];
    let mut obj = "mtllib room.mtl\n".to_owned();
    for number in 0..2000 {
        for corner in 0..8 {
            let (x, y) = (
                number % 50 * 2 + corner % 2,
                number / 50 * 2 + corner / 2 % 2,
            );
            obj += &format!("v {x} {y} {}\n", corner / 4);
        }
        obj += "usemtl white\n";
        obj.extend(CORNERS.map(|face| format!("f {face}\n")));
    }
    obj += "v 0 0 9\nv 0 9 9\nv 9 9 9\nv 9 0 9\nusemtl ceiling\nf -4 -3 -2 -1\n";
    let folder = with_scene();
    folder.write("boxes.obj", obj);
    let before = folder.files();
    // A signal that comes before anyone listens ends the program as well; then there is another.
    for patience in [0.2, 0.5, 1.0, 2.0] {
        let start = Instant::now();
        let is_time = || start.elapsed() > Duration::from_secs_f64(patience);
        let output = interrupted(folder.command("bake boxes.obj --json"), is_time);
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(folder.files() == before, "it wrote");
        if output.status.code().is_none() {
            continue;
        }
        assert_eq!(output.status.code(), Some(130), "{stderr}");
        assert!(
            stderr.starts_with("interrupted before the first row"),
            "{stderr}"
        );
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
        assert_eq!(command::one_object(&output.stdout)["interrupted"], true);
        return;
    }
    panic!("nobody ever listened");
}

#[cfg(unix)]
#[test]
fn a_main_job_that_is_interrupted_stops_before_its_next_file() {
    let folder = Folder::new();
    let picture = folder.path().join("out/light-ceiling.png");
    let output = interrupted(folder.command("--json"), || picture.exists());
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(130), "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    let report = command::one_object(&output.stdout);
    assert_eq!(report["interrupted"], true);
    let files = folder.files();
    let listed = report["files"].as_array().unwrap();
    let mut listed: Vec<&str> = listed.iter().map(|name| name.as_str().unwrap()).collect();
    assert!(listed[2] == "out/light-ceiling.png", "{listed:?}");
    assert!(listed.len() < 10, "it went on: {listed:?}");
    listed.sort_unstable();
    assert!(files.keys().eq(&listed), "{listed:?}");
}
