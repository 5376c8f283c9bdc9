//! Rows of an analytic kernel times sampled visibility, from the centre of every element.
//!
//! `F_ji = L(x_j, P_i) 1/R sum_r V(x_j, y_r)`
//!
//! `L` is Lambert's formula from the centre `x_j` of the element to the whole patch `P_i` (D. R. Baum,
//! H. E. Rushmeier and J. M. Winget, *Improving radiosity solutions through the use of analytically
//! determined form-factors*, SIGGRAPH 1989); `V` is 1 where a ray from there to the middle `y_r` of
//! one of `R` equal parts of the patch meets nothing (J. R. Wallace, K. A. Elmquist and E. A. Haines,
//! *A ray tracing algorithm for progressive radiosity*, SIGGRAPH 1989).

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relume::form_factor::point_to_polygon;
use relume::geometry::from_unit_square;
use relume::luminaire;
use relume::mesh::Mesh;
use relume::scene::Luminaire;
use relume::visibility::Visibility as _;

use crate::bvh::Bvh;
use crate::rows::RowFiller;

/// Fills rows by one factor and `side * side` rays for every element.
#[derive(Clone, Copy, Debug)]
pub struct RayRows<'a> {
    /// What blocks the rays.
    pub bvh: &'a Bvh,
    /// Parts of a patch along each of its directions.
    pub side: u32,
}

impl RowFiller for RayRows<'_> {
    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        luminaire::fill(mesh, luminaire, far, 0, self.bvh, row);
    }

    fn patch(&self, mesh: &Mesh, patch: u32, row: &mut [f32]) {
        row.fill(0.0);
        let Some(shooter) = mesh.patch_polygon(patch) else {
            return;
        };
        let side = self.side as f32;
        let middles = (0..self.side * self.side).map(|part| {
            let at = Vec2::new((part % self.side) as f32, (part / self.side) as f32);
            from_unit_square(&shooter, (at + 0.5) / side).0
        });
        let middles: Vec<Vec3> = middles.collect();
        row.par_iter_mut()
            .zip(mesh.elements)
            .for_each(|(factor, element)| {
                let Some(receiver) = mesh.element_polygon(element) else {
                    return;
                };
                let centre = receiver.center();
                let open = point_to_polygon(centre, receiver.normal(), shooter.vertices());
                if open > 0.0 {
                    let seen = middles.iter().filter(|at| self.bvh.sees(centre, **at));
                    *factor = open * seen.count() as f32 / middles.len() as f32;
                }
            });
    }
}
