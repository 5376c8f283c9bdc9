//! Solutions against the dense solution of the same form factors, and against a path tracer that
//! shares no transport code with them.

mod bake;

use bake::{baked, exact, room};
use glam::DVec3;
use relume_host::builtin::{Builtin, cornell_box};
use relume_host::bvh::Bvh;
use relume_host::reference::dense::DenseSolution;
use relume_host::reference::path_trace::{Estimate, PathTracer, Receiver};
use relume_host::rows::Parallel;
use relume_host::solution::Solution;
use relume_host::study::system::System;

/// The dense `f64` solution of the same mesh and form factors; area lights only.
fn dense(builtin: &Builtin, solution: &Solution) -> DenseSolution {
    let bvh = Bvh::for_scene(&builtin.scene.view().expect("legal"));
    let rows = Parallel::new(&solution.mesh.view(), &bvh);
    let system = System::new(solution.mesh.clone(), solution.lights.len() as u32, &rows);
    system.dense().expect("a regular system")
}

#[test]
fn refinement_converges_to_the_dense_solution() {
    let room = room();
    let solution = baked(&room.scene, &exact(&room));
    let reference = dense(&room, &solution);
    assert!(reference.residual < 1e-10);
    for light in 0..solution.lights.len() {
        let (mut difference, mut norm) = (0.0, 0.0);
        for (number, element) in solution.mesh.elements.iter().enumerate() {
            let found = solution.element(number)[light].to_array();
            for (found, exact) in found.into_iter().zip(reference.irradiance[number][light]) {
                difference += f64::from(element.area) * (f64::from(found) - exact).powi(2);
                norm += f64::from(element.area) * exact * exact;
            }
        }
        let error = (difference / norm).sqrt();
        assert!(
            error <= 1e-4,
            "light {light}: relative L2 error {error:.2e}"
        );
    }
}

/// Path-traced averages over the chosen elements, `[chosen][light]`.
fn traced(
    builtin: &Builtin,
    solution: &Solution,
    chosen: &[usize],
    samples: u32,
    seed: u64,
) -> Vec<Vec<Estimate>> {
    let mesh = solution.mesh.view();
    let receivers: Vec<Receiver> = chosen
        .iter()
        .map(|number| {
            let outline = mesh
                .element_polygon(&mesh.elements[*number])
                .expect("it is there");
            let vertices: Vec<DVec3> = outline.vertices().iter().map(|v| v.as_dvec3()).collect();
            Receiver::polygon(&vertices).expect("it has an area")
        })
        .collect();
    let tracer = PathTracer::new(&builtin.scene).expect("a legal scene");
    tracer.estimate(&receivers, samples, seed)
}

#[test]
fn monte_carlo_agrees_with_the_dense_solution() {
    let room = room();
    let solution = baked(&room.scene, &exact(&room));
    let reference = dense(&room, &solution);
    let mesh = solution.mesh.view();
    // Every 16th element: a sixteenth of the room, in every corner of it.
    let chosen: Vec<usize> = (0..mesh.elements.len()).step_by(16).collect();
    let estimates = traced(&room, &solution, &chosen, 4000, 1);
    for light in 0..solution.lights.len() {
        let (mut difference, mut variance, mut norm) = (0.0, 0.0, 0.0);
        for (number, estimates) in chosen.iter().zip(&estimates) {
            let estimate = estimates[light];
            for channel in 0..3 {
                let exact = reference.irradiance[*number][light][channel];
                difference += (estimate.irradiance[channel] - exact).powi(2);
                variance += estimate.error[channel].powi(2);
                norm += exact * exact;
            }
        }
        // What is left after the noise is the substructuring error of 1 m patches: the solver
        // notes measured 3 to 4 % for a median light; here it is 2.3 to 4.6 %.
        let error = ((difference - variance).max(0.0) / norm).sqrt();
        assert!(error < 0.06, "light {light}: {error:.3} beyond the noise");
    }
}

#[test]
fn a_fine_cornell_box_agrees_with_monte_carlo() {
    let mut builtin = cornell_box().expect("a legal scene");
    builtin.spacing.patch = 0.1;
    builtin.spacing.element = 0.025;
    let solution = baked(&builtin.scene, &exact(&builtin));
    let mesh = solution.mesh.view();
    let chosen: Vec<usize> = (0..mesh.elements.len()).step_by(41).collect();
    let estimates = traced(&builtin, &solution, &chosen, 2000, 7);
    for (light, tag) in solution.lights.iter().zip(0..) {
        let (mut difference, mut variance, mut norm) = (0.0, 0.0, 0.0);
        for (number, estimates) in chosen.iter().zip(&estimates) {
            let estimate = estimates[tag];
            for (channel, found) in solution.element(*number)[tag]
                .to_array()
                .into_iter()
                .enumerate()
            {
                difference += (estimate.irradiance[channel] - f64::from(found)).powi(2);
                variance += estimate.error[channel].powi(2);
                norm += estimate.irradiance[channel].powi(2);
            }
        }
        let error = ((difference - variance).max(0.0) / norm).sqrt();
        // Measured: 2.0 to 2.8 %, from substructuring and from shadows sampled by 16 rays.
        assert!(error < 0.04, "{}: {error:.3} beyond the noise", light.name);
    }
}
