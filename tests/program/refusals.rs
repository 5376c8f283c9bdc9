//! Input, output and use that are refused in one line, before anything is written.

use std::fs;

use super::probes::elements;
use super::{CAMERA, with_room, with_scene};
use crate::room;

#[test]
fn wrong_scenes_are_one_line_and_exit_1() {
    let folder = with_scene();
    let obj = room::obj(false);
    let with_materials = |name: &str, mtl: &str| {
        folder.write(&format!("{name}.mtl"), mtl);
        let obj = obj.replace("room.mtl", &format!("{name}.mtl"));
        folder.write(&format!("{name}.obj"), obj);
    };
    folder.write("room.txt", &obj);
    folder.write("nan.obj", obj.replacen("v 4 0 3", "v 4 NaN 3", 1));
    folder.write("huge.obj", obj.replacen("v 4 0", "v 4e10 0", 1));
    folder.write("index.obj", obj.clone() + "f 1 2 999\n");
    folder.write("empty.obj", "");
    folder.write("latin.obj", b"v 0 0 0\n# caf\xe9\n");
    with_materials("dark", &room::mtl().replace("Ke", "# Ke"));
    with_materials("minus", "newmtl white\nKd -1 0 0\n");
    let glb = room::glb();
    folder.write("cut.glb", &glb[..glb.len() / 2]);
    folder.write("text.gltf", &obj);
    let needs = r#"{"asset": {"version": "2.0"}, "extensionsRequired": ["EXT_no_such"]}"#;
    folder.write("needs.gltf", needs);
    fs::create_dir(folder.path().join("folder.obj")).unwrap();
    folder.write("out.solution", "RELUMESO as it was");
    for (scene, expected) in [
        ("missing.obj", "missing.obj: cannot be read: "),
        ("missing.glb", "missing.glb: cannot be read: "),
        ("folder.obj", "folder.obj: cannot be read: "),
        ("room.txt", "room.txt: not a known kind"),
        ("nan.obj", "line 4: vertex (4, NaN, 3) is not finite"),
        ("index.obj", "999"),
        ("empty.obj", "empty.obj: no usable face"),
        ("latin.obj", "latin.obj, line 2: not UTF-8"),
        ("huge.obj", "huge.obj: vertex (4e10, 0e0, "),
        ("dark.obj", "dark.obj: the scene has no light"),
        ("minus.obj", "minus.mtl, material \"white\""),
        ("cut.glb", "cut.glb"),
        ("text.gltf", "text.gltf"),
        ("needs.gltf", "EXT_no_such"),
    ] {
        let line = folder.refused(&format!("bake {scene} -o out.solution"));
        assert!(line.contains(expected), "{line}");
        let name = scene.split('.').next().unwrap();
        assert_eq!(line.matches(name).count(), 1, "told twice: {line}");
        assert!(line.matches("os error").count() <= 1, "told twice: {line}");
    }
}

#[test]
fn wrong_light_files_are_one_line_and_exit_1() {
    let folder = with_scene();
    let new = "[[light]]\nname = 'lamp'\nemission = 1\n";
    let old = "[[light]]\nname = 'sconce'\n";
    for (text, expected) in [
        ("[[light]\n".to_owned(), "lights.toml, line 1"),
        (
            format!("{old}emission = [1, -1, 1]"),
            "light 1 (\"sconce\")",
        ),
        (format!("{old}emission = nan"), "light 1 (\"sconce\")"),
        (format!("{old}emission = [1, 2]"), "light 1 (\"sconce\")"),
        (new.to_owned(), "the scene has no light of that name"),
        (format!("{new}kind = 'moon'"), "moon"),
        (format!("{new}kind = 'sun'"), "needs `direction"),
        (format!("{new}kind = 'sky'\ncolour = 1"), "colour"),
        (format!("{new}kind = 'sky'\nangle = 1"), "angle"),
    ] {
        folder.write("lights.toml", text);
        let line = folder.refused("bake room.obj --lights lights.toml");
        assert!(line.contains("lights.toml"), "{line}");
        assert!(line.contains(expected), "{line}");
    }
    let line = folder.refused("bake room.obj --lights none.toml");
    assert!(line.contains("none.toml: cannot be read"), "{line}");
}

#[test]
fn what_cannot_be_done_with_a_file_is_one_line_and_exit_1() {
    let folder = with_room();
    folder.done("pack room.solution --no-mesh -o bare.atlas");
    folder.write("bad.csv", "x,y,z\n1,2,3\n");
    folder.write("zero.csv", "x,y,z,nx,ny,nz\n1,2,3,0,0,0\n");
    folder.write("words.csv", "x,y,z,nx,ny,nz\n\n\n1,2,3,0,1,up\n");
    folder.write("void.csv", "");
    folder.write("bad.toml", "eye = 1\n");
    folder.write("flat.toml", CAMERA.replace("fov = 1", "fov = 9"));
    for (command, expected) in [
        ("pack none.solution", "none.solution: cannot be read"),
        ("pack room.atlas -o b", "room.atlas: this is an atlas"),
        ("pack room.obj -o b", "room.obj: neither a solution nor"),
        ("relight none.atlas", "none.atlas: cannot be read"),
        ("relight room.obj", "room.obj: neither a solution nor"),
        ("relight bare.atlas", "bare.atlas: it carries no mesh"),
        (
            "relight room.atlas --set x=1",
            "room.atlas: there is no light `x`",
        ),
        (
            "relight room.solution --only x=1",
            "lights are: ceiling, sconce",
        ),
        (
            "relight room.atlas -o a.jpg",
            "a.jpg: a picture ends in .png or .exr",
        ),
        ("relight room.atlas --camera none.toml", "none.toml"),
        ("relight room.atlas --camera bad.toml", "bad.toml"),
        (
            "relight room.atlas --camera flat.toml",
            "flat.toml: the field of view 9 is outside",
        ),
        (
            "relight room.atlas --fov -1",
            "field of view -1 is outside (0, pi) radians",
        ),
        ("relight room.atlas --set \u{1b}=1", "`\\u{1b}`"),
        ("info es\u{1b}cape", "es\\u{1b}cape: cannot be read"),
        (
            "relight room.atlas --gather",
            "room.atlas: an atlas does not keep what --gather needs",
        ),
        ("relight room.atlas --size 0x10", "0 x 10"),
        ("relight room.atlas --size 20000x10", "16384"),
        ("relight room.atlas --fov 4", "field of view 4"),
        ("relight room.atlas --eye nan,0,0", "finite"),
        (
            "relight room.atlas --eye 1,1,1 --target 1,1,1",
            "same point",
        ),
        (
            "probe bare.atlas --points points.csv",
            "bare.atlas: it carries no mesh",
        ),
        (
            "probe room.atlas --points none.csv",
            "none.csv: cannot be read",
        ),
        (
            "probe room.atlas --points bad.csv",
            "bad.csv: line 1: the header is missing",
        ),
        ("probe room.atlas --points void.csv", "void.csv: line 1"),
        ("probe room.atlas --points zero.csv", "zero.csv: line 2"),
        ("probe room.atlas --points words.csv", "words.csv: line 4"),
        ("info none.atlas", "none.atlas: cannot be read"),
        ("info room.mtl", "room.mtl: neither a solution nor"),
    ] {
        let line = folder.refused(command);
        assert!(line.contains(expected), "{line}");
        for part in ["os error", "record", "toml", "light", "16384"] {
            assert!(line.matches(part).count() <= 2, "told twice: {line}");
        }
    }
    // What an atlas without a mesh is good for.
    assert_eq!(elements(&folder, "bare.atlas", "").len(), 2 * 1016);
    folder.json("info bare.atlas");
}

#[test]
fn an_input_is_never_overwritten() {
    let folder = with_room();
    folder.write("view.toml", CAMERA);
    fs::create_dir(folder.path().join("sub")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("room.solution", folder.path().join("link")).unwrap();
    for command in [
        "bake room.obj -o room.obj",
        "bake room.obj -o sub/../room.obj",
        "pack room.solution -o room.solution",
        "pack room.solution -o ./room.solution",
        "relight room.atlas -o room.atlas",
        "relight room.atlas --camera view.toml -o view.toml",
        "probe room.atlas --elements -o room.atlas",
        "probe room.atlas --points points.csv -o points.csv",
        #[cfg(unix)]
        "pack room.solution -o link",
    ] {
        let line = folder.refused(command);
        assert!(line.contains("is an input"), "{command}: {line}");
    }
}

#[test]
fn an_output_that_cannot_be_written_is_one_line_and_exit_1() {
    let folder = with_room();
    fs::create_dir(folder.path().join("folder.png")).unwrap();
    for command in [
        "bake room.obj --element 1",
        "pack room.solution",
        "relight room.atlas --size 8x6",
        "probe room.atlas --elements",
    ] {
        for output in ["folder.png", "none/such.png", "room.obj/such.png"] {
            let line = folder.refused(&format!("{command} -o {output}"));
            let expected = format!("relume: {output}: cannot be written: ");
            assert!(line.starts_with(&expected), "{line}");
            assert!(!line.contains(".tmp"), "{line}");
        }
    }
    // A file stands where the main job wants a folder.
    folder.write("out", "");
    let before = folder.files();
    let output = folder.command("").output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.starts_with("relume: out: "), "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    assert!(folder.files() == before);
}

/// Nobody reads, or the disk is full: an error where data are lost, and never a panic.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_behind_stdout_or_stderr_is_no_panic() {
    let folder = with_room();
    let full = || fs::File::create("/dev/full").expect("Linux has it");
    for command in ["info room.atlas --json", "probe room.atlas --elements"] {
        let output = folder.command(command).stdout(full()).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        let last = stderr.lines().last().unwrap();
        assert!(last.starts_with("relume: -: cannot be written"), "{stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
    }
    let mut bake = folder.command("bake room.obj --element 1 -o silent");
    let output = bake.stderr(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(!folder.read("silent").is_empty());
}

#[test]
fn damaged_files_are_refused_by_every_command() {
    const COMMANDS: [&str; 5] = [
        "info damaged",
        "pack damaged -o out.atlas",
        "relight damaged -o out.png",
        "probe damaged --elements -o out.csv",
        "probe damaged --points points.csv -o out.csv",
    ];
    let folder = with_room();
    for name in ["room.solution", "room.atlas"] {
        let whole = folder.read(name);
        let length = whole.len();
        let cuts = [
            0,
            3,
            8,
            9,
            40,
            length / 4,
            length / 2,
            length - 4,
            length - 1,
        ];
        let mut damaged: Vec<Vec<u8>> = cuts.map(|cut| whole[..cut].to_vec()).to_vec();
        let mut change = |change: &dyn Fn(&mut Vec<u8>)| {
            damaged.push(whole.clone());
            change(damaged.last_mut().expect("just pushed"));
        };
        for part in 0..12 {
            change(&|bytes| bytes[part * length / 12 + part] ^= 1 << (part % 8));
        }
        change(&|bytes| bytes.push(0));
        change(&|bytes| bytes[8..10].fill(0xff)); // a later version
        change(&|bytes| bytes[12..32].fill(0xff)); // counts that no memory holds
        for (bytes, number) in damaged.iter().zip(0..) {
            assert!(*bytes != whole);
            folder.write("damaged", bytes);
            let line = folder.refused(COMMANDS[number % COMMANDS.len()]);
            let is_named = line.contains("damaged: ");
            assert!(is_named, "{name}, case {number}: {line}");
        }
    }
}

#[test]
fn wrong_usage_is_exit_2() {
    let folder = with_room();
    for command in [
        "--nothing",
        "unbake",
        "bake",
        "bake room.obj --nothing",
        "bake room.obj room.obj",
        "bake room.obj --lights",
        "bake room.obj --element 0",
        "bake room.obj --element nan",
        "bake room.obj --patch=-1",
        "bake room.obj --residual 0",
        "bake room.obj --shots 1.5",
        "bake room.obj --threads 0",
        "bake room.obj --method magic",
        "pack",
        "pack room.solution --code zip",
        "pack room.solution --code ceiling=zip",
        "pack room.solution --code tiles --code exp8",
        "pack room.solution --code tiles --max-error 1",
        "pack room.solution --code tiles --budget 1000",
        "pack room.solution --max-error 1 --budget 1000",
        "pack room.solution --max-error 0",
        "pack room.solution --budget many",
        "relight room.atlas --set ceiling",
        "relight room.atlas --set ceiling=-1",
        "relight room.atlas --set ceiling=#ff",
        "relight room.atlas --size large",
        "relight room.atlas --exposure dark",
        "relight room.atlas --eye 1,2",
        "relight room.atlas --eye 1,2,3 --camera view.toml",
        "probe room.atlas",
        "probe room.atlas --elements --points points.csv",
    ] {
        folder.misused(command);
        folder.misused(&format!("--json {command}"));
    }
}

#[test]
fn no_output_replaces_a_file_of_another_kind() {
    let folder = with_room();
    let before = folder.files();
    for (command, file) in [
        ("bake room.obj -o room.mtl", "room.mtl"),
        ("bake room.obj --keep-rows room.obj -o new", "room.obj"),
        ("bake room.obj --keep-rows points.csv -o new", "points.csv"),
        ("pack room.solution -o room.mtl", "room.mtl"),
    ] {
        let line = folder.refused(command);
        assert!(line.contains(file), "{line}");
    }
    folder.misused("bake room.obj --keep-rows new -o new");
    folder.misused("bake room.obj --residual 2 -o new");
    folder.misused("probe room.solution --elements --gather");
    folder.misused("relight room.solution --rays 64");
    assert!(folder.files() == before, "something was written");
}

#[cfg(unix)]
#[test]
fn names_that_are_no_text_are_written_all_the_same() {
    use std::os::unix::ffi::OsStrExt as _;
    let folder = with_room();
    let name = std::ffi::OsStr::from_bytes(b"n\xff.atlas");
    let mut command = folder.command("pack room.solution --json -o");
    let output = command.arg(name).output().expect("relume starts");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(folder.path().join(name).is_file());
}
