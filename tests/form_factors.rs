//! Form factors of polygon pairs, through the program and the library: answers, error bounds, hostile input.

mod command;
mod data;
mod skip;

use std::fs;

use command::{Folder, one_object};
use glam::DVec3;
use relume_host::polygon_pair::{ConvexPolygon, Estimate, form_factor};
use relume_host::reference::closed_form;
use serde_json::{Value, json};

fn read(path: &std::path::Path) -> Value {
    serde_json::from_slice(&fs::read(path).expect("a file")).expect("JSON")
}

/// A polygon from its vertices.
fn polygon(vertices: &[[f64; 3]]) -> ConvexPolygon {
    let vertices: Vec<DVec3> = vertices.iter().map(|v| DVec3::from_array(*v)).collect();
    ConvexPolygon::new(&vertices).expect("a convex polygon")
}

/// The parallelogram with a corner at `origin` and the sides `u` and `v`.
fn parallelogram(origin: DVec3, u: DVec3, v: DVec3) -> ConvexPolygon {
    ConvexPolygon::new(&[origin, origin + u, origin + u + v, origin + v]).expect("an area")
}

fn area(polygon: &ConvexPolygon) -> f64 {
    let v = polygon.vertices();
    let sum: DVec3 = v.windows(2).map(|w| (w[0] - v[0]).cross(w[1] - v[0])).sum();
    sum.length() / 2.0
}

/// The same polygon, seen from behind.
fn flipped(polygon: &ConvexPolygon) -> ConvexPolygon {
    let vertices: Vec<DVec3> = polygon.vertices().iter().rev().copied().collect();
    ConvexPolygon::new(&vertices).expect("the same area")
}

/// Asserts that a truth lies within an answer's error, and the answer within a relative tolerance.
fn assert_true(what: &str, found: Estimate, truth: f64, truth_error: f64, tolerance: f64) {
    let miss = (found.value - truth).abs();
    assert!(
        miss <= found.error + truth_error,
        "{what}: {found:?} does not hold {truth}"
    );
    assert!(
        miss <= tolerance * truth + truth_error,
        "{what}: {found:?} is off {truth}"
    );
    assert!(
        found.error <= tolerance * truth + 1e-11,
        "{what}: {found:?} is too vague about {truth}"
    );
}

#[test]
fn the_program_agrees_with_the_reference_on_every_case() {
    let Some(data) = data::data_dir() else { return };
    let data = data.join("form_factors");
    let (cases, truths) = (
        read(&data.join("cases.json")),
        read(&data.join("answers.json")),
    );
    let folder = Folder::new();
    let answers = folder.json(&format!(
        "form-factor {}",
        data.join("cases.json").display()
    ));
    let list = |value: &Value| value["cases"].as_array().expect("a list").clone();
    let (cases, truths, answers) = (list(&cases), list(&truths), list(&answers));
    assert_eq!(answers.len(), cases.len());
    for ((case, truth), answer) in cases.iter().zip(&truths).zip(&answers) {
        assert_eq!(answer["name"], case["name"]);
        let number = |value: &Value| value.as_f64().expect("a number");
        let is_occluded = case["blockers"].as_array().is_some_and(|b| !b.is_empty());
        let found = Estimate {
            value: number(&answer["f"]),
            error: number(&answer["error"]),
        };
        assert_true(
            case["name"].as_str().expect("a name"),
            found,
            number(&truth["f"]),
            number(&truth["standard_error"]),
            if is_occluded { 1e-4 } else { 1e-5 },
        );
    }
}

#[test]
fn rectangles_agree_with_the_catalogue_at_any_proportion() {
    for (a, b, c) in [
        (1.0, 1.0, 1.0),
        (64.0, 1.0, 1.0),
        (1.0, 1.0 / 1024.0, 0.5),
        (3.0, 2.0, 1.0 / 1024.0),
        (1.0, 1.0, 40.0),
    ] {
        let floor = parallelogram(DVec3::ZERO, DVec3::X * a, DVec3::Y * b);
        let lid = parallelogram(DVec3::Z * c, DVec3::Y * b, DVec3::X * a);
        let truth = closed_form::parallel_rectangles(a, b, c);
        // The catalogue's formula itself cancels: see its module.
        let cancelled = 1e-15 * (c / a.min(b)).max(1.0).powi(4);
        assert_true(
            "parallel",
            form_factor(&floor, &lid, &[]),
            truth,
            cancelled,
            1e-5,
        );

        let wall = parallelogram(DVec3::ZERO, DVec3::Y * b, DVec3::Z * c);
        let truth = closed_form::perpendicular_rectangles(b, a, c);
        let cancelled = 1e-14 * (a / b + b / a) * (c / b).max(1.0).powi(2);
        assert_true(
            "perpendicular",
            form_factor(&floor, &wall, &[]),
            truth,
            cancelled,
            1e-5,
        );
    }
}

/// A room `x` by `y` by `z`: floor, ceiling and walls, all facing inwards.
fn room(x: f64, y: f64, z: f64) -> Vec<ConvexPolygon> {
    let (u, v, w) = (DVec3::X * x, DVec3::Y * y, DVec3::Z * z);
    vec![
        parallelogram(DVec3::ZERO, u, v),
        parallelogram(w, v, u),
        parallelogram(DVec3::ZERO, v, w),
        parallelogram(u, w, v),
        parallelogram(DVec3::ZERO, w, u),
        parallelogram(v, u, w),
    ]
}

/// Asserts that every face of a closed scene sees the others as one whole, and reciprocity.
fn assert_closed(faces: &[ConvexPolygon], tolerance: f64) {
    let blockers = |i: usize, j: usize| -> Vec<ConvexPolygon> {
        let others = faces.iter().enumerate().filter(|(k, _)| *k != i && *k != j);
        others.map(|(_, face)| face.clone()).collect()
    };
    for (i, from) in faces.iter().enumerate() {
        let (mut sum, mut error) = (0.0, 0.0);
        for (j, to) in faces.iter().enumerate().filter(|(j, _)| *j != i) {
            let there = form_factor(from, to, &blockers(i, j));
            let back = form_factor(to, from, &blockers(i, j));
            let difference = there.value * area(from) - back.value * area(to);
            let allowed = there.error * area(from) + back.error * area(to);
            assert!(difference.abs() <= allowed, "{i} {j}: {there:?} {back:?}");
            sum += there.value;
            error += there.error;
        }
        assert!((sum - 1.0).abs() <= error + 1e-12, "{i}: {sum} +- {error}");
        assert!((sum - 1.0).abs() <= tolerance, "{i}: {sum}");
    }
}

#[test]
fn closed_rooms_of_any_shape_and_scale_are_closed() {
    for (x, y, z) in [
        (1.0, 1.0, 1.0),
        (1e-6, 1e-6, 3e-6),
        (1e6, 3e6, 1e6),
        (1.0, 1.0, 1.0 / 256.0),
    ] {
        assert_closed(&room(x, y, z), 1e-6);
    }
}

#[test]
fn a_room_with_a_wall_inside_is_closed() {
    let mut faces = room(2.0, 1.0, 1.0);
    let wall = parallelogram(DVec3::new(0.75, 0.25, 0.0), DVec3::Y * 0.5, DVec3::Z * 0.75);
    faces.extend([flipped(&wall), wall]);
    assert_closed(&faces, 1e-5);
}

#[test]
fn an_l_shaped_room_is_closed() {
    let corners = [
        (0.0, 0.0),
        (2.0, 0.0),
        (2.0, 1.0),
        (1.0, 1.0),
        (1.0, 2.0),
        (0.0, 2.0),
    ];
    let up = DVec3::Z;
    let walls = corners.iter().zip(corners.iter().cycle().skip(1));
    let mut faces: Vec<ConvexPolygon> = walls
        .map(|(a, b)| {
            let (a, b) = (DVec3::new(a.0, a.1, 0.0), DVec3::new(b.0, b.1, 0.0));
            parallelogram(a, up, b - a)
        })
        .collect();
    for (origin, u, v) in [
        (DVec3::ZERO, DVec3::X * 2.0, DVec3::Y),
        (DVec3::Y, DVec3::X, DVec3::Y),
    ] {
        faces.push(parallelogram(origin, u, v));
        faces.push(parallelogram(origin + up, v, u));
    }
    assert_closed(&faces, 1e-5);
}

#[test]
fn books_at_any_angle_agree_with_their_own_halves() {
    for degrees in [0.2_f64, 15.0, 90.0, 165.0, 179.8, 179.98] {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let (left, lean) = (DVec3::X, DVec3::new(cosine, 0.0, sine));
        let page = parallelogram(DVec3::ZERO, left, DVec3::Y);
        let whole = form_factor(&page, &parallelogram(DVec3::ZERO, DVec3::Y, lean), &[]);
        let halves = [(0.0, 0.3125), (0.3125, 0.6875)].map(|(start, length)| {
            form_factor(
                &page,
                &parallelogram(DVec3::Y * start, DVec3::Y * length, lean),
                &[],
            )
        });
        let sum = halves[0].value + halves[1].value;
        let error = whole.error + halves[0].error + halves[1].error;
        assert!(
            (sum - whole.value).abs() <= error,
            "{degrees}: {sum} {whole:?}"
        );
        assert!(error < 4e-6 * whole.value, "{degrees}: {error} {whole:?}");
    }
}

/// Unit squares, the second one `gap` above the first.
fn plates(gap: f64) -> [ConvexPolygon; 2] {
    [
        parallelogram(DVec3::ZERO, DVec3::X, DVec3::Y),
        parallelogram(DVec3::Z * gap, DVec3::Y, DVec3::X),
    ]
}

#[test]
fn a_fin_between_plates_leaves_the_two_chambers() {
    for gap in [0.25, 1.0 / 64.0, 1.0 / 1024.0] {
        let [floor, lid] = plates(gap);
        let at = 0.375;
        let fin = parallelogram(DVec3::X * at, DVec3::Y, DVec3::Z * gap);
        let chambers = [(0.0, at), (at, 1.0 - at)].map(|(start, width)| {
            let floor = parallelogram(DVec3::X * start, DVec3::X * width, DVec3::Y);
            let lid = parallelogram(DVec3::new(start, 0.0, gap), DVec3::Y, DVec3::X * width);
            width * form_factor(&floor, &lid, &[]).value
        });
        let truth = chambers[0] + chambers[1];
        assert_true(
            &format!("gap {gap}"),
            form_factor(&floor, &lid, &[fin]),
            truth,
            1e-9,
            1e-4,
        );
    }
}

#[test]
fn blockers_that_close_a_plane_leave_exactly_nothing_and_a_hole_what_it_shows() {
    let [floor, lid] = plates(1.0);
    let open = form_factor(&floor, &lid, &[]).value;
    for angle in [0.0_f64, 0.3] {
        let (sine, cosine) = angle.sin_cos();
        let (u, v) = (
            DVec3::new(cosine, sine, 0.0),
            DVec3::new(-sine, cosine, 0.0),
        );
        let tile = |i: f64, j: f64| {
            parallelogram(
                DVec3::new(0.5, 0.5, 0.25) + u * (i - 1.5) + v * (j - 1.5),
                u,
                v,
            )
        };
        let mut tiles: Vec<ConvexPolygon> = (0..9)
            .map(|k| tile(f64::from(k % 3), f64::from(k / 3)))
            .collect();
        let dark = form_factor(&floor, &lid, &tiles);
        assert_eq!(dark.value, 0.0);
        assert!(dark.error < 1e-9, "{dark:?}");

        let hole = tiles.remove(4);
        let seen = form_factor(&floor, &lid, &tiles);
        let hidden = form_factor(&floor, &lid, &[hole]);
        let error = seen.error + hidden.error;
        assert!(
            (seen.value + hidden.value - open).abs() <= error + 1e-8,
            "{seen:?} {hidden:?} {open}"
        );
    }
}

#[test]
fn blockers_that_are_not_between_change_nothing() {
    let [floor, lid] = plates(1.0);
    let open = form_factor(&floor, &lid, &[]);
    let plate = |z: f64| parallelogram(DVec3::new(-1.0, -1.0, z), DVec3::X * 3.0, DVec3::Y * 3.0);
    let beside = parallelogram(DVec3::X, DVec3::Y, DVec3::Z);
    for blocker in [plate(-0.5), plate(0.0), plate(1.0), plate(1.5), beside] {
        assert_eq!(
            form_factor(&floor, &lid, std::slice::from_ref(&blocker)),
            open,
            "{blocker:?}"
        );
    }
}

#[test]
fn place_and_scale_change_nothing() {
    let blocker = [[0.25, 0.3, 0.5], [0.8, 0.2, 0.4], [0.6, 0.9, 0.6]];
    let (from, to) = (
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0]],
        [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 0.5, 1.5]],
    );
    let of = |scale: f64, shift: f64| {
        let moved = |v: [[f64; 3]; 3]| polygon(&v.map(|p| p.map(|c| c * scale + shift)));
        let (from, to, blocker) = (moved(from), moved(to), moved(blocker));
        [
            form_factor(&from, &to, &[]),
            form_factor(&from, &to, &[blocker]),
        ]
    };
    for (scale, shift) in [(1e-6, 0.0), (1e6, 0.0), (1.0, 4096.0), (1e-3, 1.0)] {
        for (moved, still) in of(scale, shift).into_iter().zip(of(1.0, 0.0)) {
            let allowed = moved.error + still.error + 1e-11;
            assert!(
                (moved.value - still.value).abs() <= allowed,
                "{scale} {shift}: {moved:?} {still:?}"
            );
        }
    }
}

#[test]
fn the_answer_goes_where_it_is_asked_to() {
    let folder = Folder::new();
    let square = json!([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]);
    let lid = json!([[0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1]]);
    let case = json!({"name": "plates", "from": square, "to": lid});
    folder.write("cases.json", json!({"cases": [case, case]}).to_string());
    let (stdout, stderr) = folder.told("form-factor cases.json");
    let answer = one_object(&stdout);
    assert!(stderr.contains("median"), "{stderr}");
    assert_eq!(answer["cases"].as_array().map(Vec::len), Some(2));
    let value = answer["cases"][0]["f"].as_f64().expect("a number");
    assert!((value - 0.199_824_895_698).abs() < 1e-9, "{value}"); // Howell C-11

    assert_eq!(folder.json("form-factor cases.json"), answer);
    assert_eq!(
        one_object(&folder.done("form-factor cases.json -o -")),
        answer
    );
    let report = folder.json("form-factor cases.json -o answers.json");
    assert_eq!(report, json!({"file": "answers.json", "cases": 2}));
    assert_eq!(one_object(&folder.read("answers.json")), answer);

    let solver = one_object(&folder.done("form-factor cases.json --method solver"));
    let (found, error) = (&solver["cases"][0]["f"], &solver["cases"][0]["error"]);
    let miss = (found.as_f64().expect("a number") - value).abs();
    assert!(miss <= error.as_f64().expect("a number"), "{solver}");
    assert!(miss < 0.01, "{solver}");
    folder.misused("form-factor cases.json --method guess");
}

#[test]
fn bad_cases_are_refused_with_their_name_and_a_remedy() {
    let folder = Folder::new();
    let good = || json!([[0, 0, 0], [1, 0, 0], [0, 1, 0]]);
    let refused = |text: &str| {
        folder.write("bad.json", text);
        let line = folder.refused("form-factor bad.json");
        assert!(line.contains("bad.json"), "{line}");
        line
    };
    for text in [
        "",
        "{",
        "[]",
        "{\"cases\": 3}",
        "{\"cases\": [NaN]}",
        "\u{0}",
        "{\"cases\": [1e999]}",
    ] {
        let line = refused(text);
        assert!(line.contains("write {\"cases\": [...]}"), "{line}");
    }
    for polygon in [
        json!(null),
        json!("square"),
        json!([]),
        json!([[0, 0, 0], [1, 0, 0]]),
        json!([[0, 0, 0], [1, 0, 0], [1, 0]]),
        json!([[0, 0, 0], [1, 0, 0], [0, 1, null]]),
        json!([[0, 0, 0], [1, 0, 0], [0, 1, "NaN"]]),
        json!([[0, 0, 0], [1, 0, 0], [0, 1, 1e300]]),
        json!([[0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        json!([[0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 0]]),
        json!([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]]),
        json!([[0, 0, 0], [2, 0, 0], [0.5, 0.5, 0], [0, 2, 0]]),
        json!([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0.0]]),
        json!([
            [0, 0, 0],
            [1, 0, 0],
            [0, 1, 0],
            [0, 0, 0],
            [1, 0, 0],
            [0, 1, 0]
        ]),
    ] {
        for field in ["from", "to", "blockers"] {
            let mut case = json!({"name": "this one", "from": good(), "to": good()});
            case[field] = if field == "blockers" {
                json!([polygon])
            } else {
                polygon.clone()
            };
            let line = refused(&json!({"cases": [case]}).to_string());
            let place = if field == "blockers" {
                "blocker 0"
            } else {
                field
            };
            assert!(line.contains(&format!("`this one`, {place}: ")), "{line}");
            assert!(
                ["give", "divide", "leave"].iter().any(|r| line.contains(r)),
                "{line}"
            );
        }
    }
    let line = refused(&json!({"cases": [{"from": good(), "to": good()}]}).to_string());
    assert!(
        line.contains("case 0") && line.contains("give it one"),
        "{line}"
    );
    let line = refused(&json!({"cases": [{"name": "a", "to": good()}]}).to_string());
    assert!(line.contains("`a`, from is missing"), "{line}");
    let speck = json!([[0, 0, 0], [0, 1e-90, 0], [1e-90, 0, 0]]);
    let line = refused(&json!({"cases": [{"name": "a", "from": speck, "to": good()}]}).to_string());
    assert!(line.contains("`a`: one polygon is 1e30 times"), "{line}");
    let five = json!([[0, 0, 0], [2, 0, 0], [3, 1, 0], [1, 2, 0], [0, 1, 0]]);
    folder.write(
        "five.json",
        json!({"cases": [{"name": "5", "from": five, "to": good()}]}).to_string(),
    );
    folder.done("form-factor five.json");
    let line = folder.refused("form-factor five.json --method solver");
    assert!(
        line.contains("`5`") && line.contains("use --method exact"),
        "{line}"
    );
    folder.refused("form-factor nothing.json");
}
