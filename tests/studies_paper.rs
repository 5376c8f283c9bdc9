//! `relume study paper`: what its tables count and how exact they are; times are printed, not judged.

use relume_host::study::paper::{cached, faces, job, reconstruction, sampling};

#[test]
fn combined_and_tagged_solves_choose_the_same_patches() {
    for lights in [3, 8] {
        let column = sampling::measure(lights, 1).expect("a legal room");
        assert_eq!(column.lights, lights);
        assert!(column.alike >= 0.9, "{column:?}");
        let times = [
            column.combined,
            column.separate,
            column.tagged,
            column.row,
            column.lane,
        ];
        assert!(times.iter().all(|time| *time > 0.0), "{column:?}");
    }
}

#[test]
fn rows_do_not_depend_on_reflectance_and_none_is_evaluated_twice() {
    let rows = cached::rows().expect("a legal room");
    let [dim, bright] = rows.as_slice() else {
        panic!("two reflectances: {rows:?}");
    };
    assert_eq!((dim.rows, dim.shooters), (bright.rows, bright.shooters));
    for rows in [dim, bright] {
        assert!(rows.rows as usize <= rows.shooters, "{rows:?}");
        assert!(rows.shooters <= 3 * rows.patches + 8, "{rows:?}");
    }
}

#[test]
fn exact_rows_close_the_room_and_leave_hemicubes_behind() {
    let job = job::measure(1).expect("a legal room");
    assert!(job.sums <= 1e-5, "{job:?}");
    // Measured: 13 against fine rows, five orders of magnitude against the same rows.
    assert!(job.converged_error.fine >= 5.0 * job.error.fine, "{job:?}");
    assert!(
        job.hemicube_error.dense_patch >= 100.0 * job.error.dense_patch,
        "{job:?}"
    );
}

#[test]
fn kept_rows_reach_one_percent_with_no_more_rows_than_patches_and_lights() {
    let eight = cached::measure(8, 1).expect("a legal room");
    assert!(eight.tagged_rows <= 68, "{eight:?}");
    assert!(eight.separate_rows <= 8 * 61, "{eight:?}");
    assert!(eight.separate_rows >= 6 * eight.tagged_rows, "{eight:?}");
}

#[test]
fn the_cube_of_the_spotlight_paper_has_its_faces() {
    for (side, count) in [(1, 6), (2, 24), (4, 96)] {
        let column = faces::measure(side, 1).expect("a legal cube");
        assert_eq!(column.faces, count);
        assert!(column.exact_sums <= 1e-5 && column.sums > 0.1, "{column:?}");
        assert!((5..100).contains(&column.sweeps), "{column:?}");
    }
}

#[test]
fn codes_take_three_bytes_for_each_element_and_light() {
    let column = reconstruction::measure(3, 1).expect("a legal room");
    assert_eq!(column.codes, 3 * 960 * 3);
    assert!(column.atlas > column.codes);
}
