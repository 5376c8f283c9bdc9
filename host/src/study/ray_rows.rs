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
use relume::form_factor::{Shooter, point_to_polygon};
use relume::geometry::from_unit_square;
use relume::luminaire;
use relume::mesh::Mesh;
use relume::scene::Luminaire;
use relume::visibility::Visibility;

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
    fn visibility(&self) -> &impl Visibility {
        self.bvh
    }

    fn luminaire(&self, mesh: &Mesh, luminaire: &Luminaire, far: f32, row: &mut [f32]) {
        luminaire::fill(mesh, luminaire, far, 0, self.bvh, row);
    }

    fn shooter(&self, mesh: &Mesh, shooter: &Shooter, row: &mut [f32]) {
        let shooter = shooter.polygon();
        row.fill(0.0);
        let side = self.side as f32;
        let middles = (0..self.side * self.side).map(|part| {
            let at = Vec2::new((part % self.side) as f32, (part / self.side) as f32);
            from_unit_square(shooter, (at + 0.5) / side).0
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bake::Meshed;
    use crate::builtin::{PaperLamps, paper_room, white_furnace};
    use crate::rows::Parallel;
    use crate::study::meshed;

    /// Area-weighted relative L2 difference of a row from the exact one.
    fn difference(meshed: &Meshed, patch: u32, side: u32) -> f32 {
        let (mesh, bvh) = (&meshed.mesh().view(), meshed.bvh());
        let mut exact = vec![0.0; mesh.elements.len()];
        let mut found = exact.clone();
        Parallel::new(mesh, bvh).patch(mesh, patch, &mut exact);
        RayRows { bvh, side }.patch(mesh, patch, &mut found);
        let square = |value: f32, area: f32| area * value * value;
        let pairs = || exact.iter().zip(&found).zip(mesh.elements);
        let all: f32 = pairs().map(|((e, _), el)| square(*e, el.area)).sum();
        let off: f32 = pairs().map(|((e, f), el)| square(e - f, el.area)).sum();
        (off / all).sqrt()
    }

    #[test]
    fn where_nothing_blocks_only_the_centre_is_an_error() {
        let furnace = white_furnace(0.5, 1.0).unwrap();
        let meshed = meshed(&furnace, 0.5, 0.125);
        for side in [1, 4] {
            let off = difference(&meshed, 3, side);
            assert!(off < 0.05, "{side}: {off}");
        }
    }

    #[test]
    fn more_rays_see_the_box_better() {
        let room = paper_room(PaperLamps::One).unwrap();
        let meshed = meshed(&room, 1.0, 0.25);
        // The floor under the box.
        let off = [1, 2, 4].map(|side| difference(&meshed, 4, side));
        assert!(off[0] > off[1] && off[1] > off[2], "{off:?}");
        assert!(off[2] < 0.1, "{off:?}");
    }
}
