//! Cases about form factors: kernels, hemicubes, slivers, what touches and what overlaps.

use anyhow::{Context, Result};
use glam::{DVec3, Vec3};
use relume::color::Rgb;
use relume::form_factor::Shooter;
use relume::geometry::Polygon;
use relume::visibility::Occluders;

use super::Case;
use super::naive::{
    EpsilonRays, Kernel, RAY_EPSILON, UNOCCLUDED, normalised, point_to_patch, point_to_point,
};
use super::scenes::{Stage, ceiling_square, furnace_box, furnace_error, grey_room, sum_error};
use crate::builtin::Builder;
use crate::reference::closed_form::{self, parallel_rectangles, perpendicular_rectangles};
use crate::study::hemicube::Hemicube;
use crate::study::system::{System, Way};

/// Residual of solves whose rows are what is measured.
const CONVERGED: Way = Way::kept(u32::MAX, 1e-6);

pub fn cases() -> Result<Vec<Case>> {
    Ok(vec![
        touching_elements()?,
        centre_hemicube()?,
        slivers()?,
        coplanar_overlap()?,
        lamp_on_a_wall()?,
        t_junction()?,
        closed_box()?,
        open_scene()?,
    ])
}

/// Receiver sums in a closed cube; elements touch patches on three sides.
fn touching_elements() -> Result<Case> {
    let stage = Stage::new(furnace_box(Vec3::ONE, 0.5)?, 0.25, 0.125);
    let naive = stage.system(|_| Kernel {
        kernel: point_to_point,
        visibility: &UNOCCLUDED,
    })?;
    Ok(Case {
        name: "point-to-point kernel on touching elements".into(),
        quantity: "largest |receiver sum - 1|, closed cube",
        method: "cos a cos b A / (pi r^2) between centres (West 2007)",
        naive: sum_error(&naive),
        ours: sum_error(&stage.exact()?),
        bound: 1e-5,
        why: "Lambert's formula is exact at every point, so only f32 rounding is left",
    })
}

/// A furnace solved with rows of hemicubes at the patches' centres.
fn centre_hemicube() -> Result<Case> {
    let reflectance = 0.5;
    let stage = Stage::new(furnace_box(Vec3::ONE, reflectance)?, 0.5, 0.125);
    let bvh = stage.bvh()?;
    let naive = stage.system(|_| Hemicube {
        surfaces: &stage.scene.surfaces,
        bvh: &bvh,
        resolution: 128,
    })?;
    let error = |system: &System| -> Result<f64> {
        let refined = system.refine(CONVERGED)?;
        Ok(furnace_error(&refined.irradiance, reflectance.into()))
    };
    Ok(Case {
        name: "hemicube at the patch's centre only".into(),
        quantity: "largest relative error of irradiance, furnace of reflectance 0.5",
        method: "one 128 x 128 hemicube per shooter (Cohen and Greenberg 1985; Cohen et al. 1988)",
        naive: error(&naive)?,
        ours: error(&stage.exact()?)?,
        bound: 1e-5 / (1.0 - f64::from(reflectance)),
        why: "receiver sums are one to 1e-5, and 1 / (1 - rho) bounces repeat the error",
    })
}

/// A closed slab of which four walls are 1 m by 0.1 mm.
fn slivers() -> Result<Case> {
    let reflectance = 0.5;
    let size = Vec3::new(1.0, 1e-4, 1.0);
    let stage = Stage::new(furnace_box(size, reflectance)?, 1.0, 1.0);
    let naive = stage.system(|_| Kernel {
        kernel: point_to_point,
        visibility: &UNOCCLUDED,
    })?;
    let error = |system: &System| -> Result<f64> {
        let refined = system.refine(CONVERGED)?;
        Ok(furnace_error(&refined.irradiance, reflectance.into()))
    };
    Ok(Case {
        name: "slivers, 1 : 10^4".into(),
        quantity: "largest relative error of irradiance, slab of 1 m x 1 m x 0.1 mm as a furnace",
        method: "cos a cos b A / (pi r^2) between centres, at most 1 (West 2007)",
        naive: error(&naive)?,
        ours: error(&stage.exact()?)?,
        bound: 1e-3,
        why: "the gap is 1e-4 of the coordinates, whose rounding of 6e-8 is 6e-4 of it",
    })
}

/// A furnace with a sheet that lies in the plane of its floor.
fn coplanar_overlap() -> Result<Case> {
    let reflectance = 0.5;
    let mut scene = furnace_box(Vec3::ONE, reflectance)?;
    let mut builder = Builder::default();
    let light = builder.light("walls", Rgb::WHITE);
    let sheet = [(0.25, 0.25), (0.25, 0.75), (0.75, 0.75), (0.75, 0.25)];
    let sheet = sheet.map(|(x, z)| Vec3::new(x, 0.0, z));
    builder.lamp(&sheet, Rgb::splat(reflectance), light)?;
    scene.surfaces.append(&mut builder.scene.surfaces);
    scene.textures.push(None);
    let stage = Stage::new(scene, 0.5, 0.25);
    let rays = EpsilonRays {
        surfaces: &stage.scene.surfaces,
        epsilon: RAY_EPSILON,
    };
    let naive = stage.system(|_| Kernel {
        kernel: point_to_patch,
        visibility: &rays,
    })?;
    let ours = stage.exact()?;
    Ok(Case {
        name: "coplanar overlap".into(),
        quantity: "largest |receiver sum - 1|, closed cube with a sheet in the plane of its floor",
        method: "rays that start 1e-3 off every surface (pbrt's RAY_EPSILON, Pharr and Humphreys 2004)",
        naive: sum_error(&naive),
        ours: sum_error(&ours),
        bound: 1e-5,
        why: "of two surfaces in one place a receiver should see one",
    })
}

/// A lamp that stands on a wall: the element that it touches.
fn lamp_on_a_wall() -> Result<Case> {
    let edge = 0.25;
    let wall = quad(
        [(0.0, 0.0), (edge, 0.0), (edge, edge), (0.0, edge)],
        |x, y| Vec3::new(x, y, 0.0),
    )?;
    let lamp = quad(
        [(0.0, 0.0), (edge, 0.0), (edge, edge), (0.0, edge)],
        |x, z| Vec3::new(x, 0.0, z),
    )?;
    let lamp = if lamp.normal().y > 0.0 {
        lamp
    } else {
        lamp.flipped()
    };
    let truth = perpendicular_rectangles(1.0, 1.0, 1.0);
    let ours = Shooter::new(lamp).form_factor(&wall, &Occluders(&[]));
    let error = |found: f32| (f64::from(found) / truth - 1.0).abs();
    Ok(Case {
        name: "a light that touches a wall".into(),
        quantity: "relative error of the form factor from the element that it touches (closed form)",
        method: "cos a cos b A / (pi r^2) between centres (West 2007)",
        naive: error(point_to_point(&wall, &lamp)),
        ours: error(ours),
        bound: 0.01,
        why: "1 %, from where on data/form_factors counts a method as failed",
    })
}

/// The light that an element of the paper's mesh receives, whole and as two halves that meet in a vertex
/// on its neighbours' edges; one of the paper's lamps hangs 0.5 m over one of the two T-vertices.
fn t_junction() -> Result<Case> {
    let lamp = ceiling_square(Vec3::new(0.125, 0.5, 0.0), 0.2);
    let lamp = Polygon::new(&lamp).context("the lamp")?;
    let floor = |x, z| Vec3::new(x, 0.0, z);
    let whole = quad([(0.0, 0.0), (0.0, 0.25), (0.25, 0.25), (0.25, 0.0)], floor)?;
    let halves = [
        quad(
            [(0.0, 0.0), (0.0, 0.25), (0.125, 0.25), (0.125, 0.0)],
            floor,
        )?,
        quad(
            [(0.125, 0.0), (0.125, 0.25), (0.25, 0.25), (0.25, 0.0)],
            floor,
        )?,
    ];
    let at_vertices = |receiver: &Polygon| {
        let outline: Vec<DVec3> = lamp.vertices().iter().map(|v| v.as_dvec3()).collect();
        let vertices = receiver.vertices().iter();
        let values = vertices.map(|v| {
            closed_form::point_to_polygon(v.as_dvec3(), receiver.normal().as_dvec3(), &outline)
        });
        values.sum::<f64>() / 4.0
    };
    let shooter = Shooter::new(lamp);
    let averaged = |receiver: &Polygon| f64::from(shooter.form_factor(receiver, &Occluders(&[])));
    let gap = |value: &dyn Fn(&Polygon) -> f64| {
        let parts = (value(&halves[0]) + value(&halves[1])) / 2.0;
        (value(&whole) / parts - 1.0).abs()
    };
    Ok(Case {
        name: "T-junctions".into(),
        quantity: "relative difference of the light on a face and on the two halves that share its T-vertices",
        method: "values at vertices, interpolated (Cohen and Greenberg 1985; Baum et al. 1991 on T-vertices)",
        naive: gap(&at_vertices),
        ours: gap(&averaged),
        bound: 0.01,
        why: "elements share no vertices; 1 % is where data/form_factors counts a method as failed",
    })
}

/// A lamp in a closed box in a room with another lamp: what of its light gets out.
fn closed_box() -> Result<Case> {
    let mut room = grey_room(Vec3::splat(3.0), 0.5)?;
    for wall in crate::builtin::cuboid(Vec3::splat(1.0), Vec3::splat(2.0)) {
        room.two_sided(&wall, Rgb::splat(0.5))?;
    }
    let inside = room.light("inside", Rgb::WHITE);
    room.lamp(&ceiling_square(Vec3::splat(1.5), 0.2), Rgb::BLACK, inside)?;
    let outside = room.light("outside", Rgb::WHITE);
    room.lamp(
        &ceiling_square(Vec3::new(0.5, 2.9, 0.5), 0.2),
        Rgb::BLACK,
        outside,
    )?;
    let stage = Stage::new(room.scene, 1.0, 0.25);
    let naive = stage.system(|_| Kernel {
        kernel: point_to_patch,
        visibility: &UNOCCLUDED,
    })?;
    let leak = |system: &System| -> Result<f64> {
        let mesh = system.mesh.view();
        let irradiance = system.refine(CONVERGED)?.irradiance;
        let walls = mesh
            .elements
            .iter()
            .zip(&irradiance)
            .filter(|(element, _)| {
                mesh.element_face(element)
                    .is_some_and(|face| face.surface < 6)
            });
        let power = |(element, values): (&relume::mesh::Element, &Vec<[f64; 3]>)| {
            f64::from(element.area) * values[0][0]
        };
        Ok(walls.map(power).sum::<f64>() / f64::from(0.2_f32 * 0.2))
    };
    Ok(Case {
        name: "a light inside a closed box".into(),
        quantity: "power that arrives outside, as a share of what the lamp emits",
        method: "form factors of an unoccluded environment (Goral et al. 1984)",
        naive: leak(&naive)?,
        ours: leak(&stage.exact()?)?,
        bound: 1e-6,
        why: "nothing may get out; rounding of f32 is 6e-8",
    })
}

/// Two facing plates and nothing else.
fn open_scene() -> Result<Case> {
    let reflectance = 0.8_f32;
    let mut plates = Builder::default();
    let light = plates.light("lower", Rgb::WHITE);
    let upper = ceiling_square(Vec3::new(0.5, 1.0, 0.5), 1.0);
    let lower = ceiling_square(Vec3::new(0.5, 0.0, 0.5), 1.0);
    plates.surface(&upper, Rgb::splat(reflectance))?;
    plates.lamp(
        &crate::builtin::reversed(lower),
        Rgb::splat(reflectance),
        light,
    )?;
    let stage = Stage::new(plates.scene, 1.0, 0.125);
    let ours = stage.exact()?;
    // E_1 = F B_2, B_2 = 1 + rho E_2, E_2 = F rho E_1 (means over the plates; each shoots as a whole).
    let factor = parallel_rectangles(1.0, 1.0, 1.0);
    let truth = factor / (1.0 - (f64::from(reflectance) * factor).powi(2));
    let error = |system: &System| -> Result<f64> {
        let irradiance = system.refine(CONVERGED)?.irradiance;
        let upper = system.mesh.faces[0].element_range();
        let values = irradiance[upper.start as usize..upper.end as usize].iter();
        let count = f64::from(upper.end - upper.start);
        let mean = values.map(|values| values[0][0]).sum::<f64>() / count;
        Ok((mean / truth - 1.0).abs())
    };
    Ok(Case {
        name: "open scene".into(),
        quantity: "relative error of the mean irradiance of a plate over another (closed form)",
        method: "rows divided by their sum (West 2007)",
        naive: error(&normalised(&ours))?,
        ours: error(&ours)?,
        bound: 1e-4,
        why: "two-point Gauss rules on eighths of the distance: (1/8)^4 = 2e-4, over 4320/2 for the rule",
    })
}

/// A square in some plane.
fn quad(corners: [(f32, f32); 4], place: impl Fn(f32, f32) -> Vec3) -> Result<Polygon> {
    let corners = corners.map(|(s, t)| place(s, t));
    Polygon::new(&corners).context("a square")
}
