//! OBJ scenes.
//!
//! Every `f` is one polygon, in file order and with its vertices as they stand. Materials are those
//! of [`super::obj_materials`]; faces without one, or whose material no file has, reflect the
//! default. Texture coordinates count from the bottom in OBJ and from the top here.

use std::collections::HashMap;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::draft::{Draft, Material, Outline};
use super::error::{ImportError, read_text};
use super::obj_materials::Library;
use super::obj_text::plain_obj;
use super::repairs::Repairs;

/// Polygons stay polygons, and positions and texture coordinates keep indices of their own.
const PARSER: tobj::LoadOptions = tobj::LoadOptions {
    single_index: false,
    triangulate: false,
    ignore_points: true,
    ignore_lines: true,
};

/// What an OBJ file and its MTL files say.
pub(super) fn read(path: &Path, repairs: &mut Repairs) -> Result<Draft, ImportError> {
    let text = read_text(path)?;
    let plain = plain_obj(text.trim_start_matches('\u{feff}'))
        .map_err(|(line, fault)| ImportError::line(path, line, fault))?;
    drop(text);
    repairs.skipped_points_and_lines += plain.skipped;
    repairs.degenerate_faces += plain.too_small;

    let library = Library::load(path, &plain.libraries, repairs)?;
    let (models, materials) = tobj::load_obj_buf(&mut plain.text.as_bytes(), &PARSER, |name| {
        library.parsed(name)
    })
    .map_err(|error| ImportError::file(path, error))?;
    let materials = materials.unwrap_or_default();

    let mut draft = Draft::default();
    let mut numbers: HashMap<Option<&str>, usize> = HashMap::new();
    for tobj::Model { mesh, .. } in &models {
        let name = mesh
            .material_id
            .and_then(|id| materials.get(id))
            .map(|m| m.name.as_str());
        let described = name.and_then(|name| library.get(name));
        let number = *numbers.entry(name).or_insert_with(|| {
            draft.add_material(
                described
                    .cloned()
                    .unwrap_or_else(|| Material::unknown(true)),
            )
        });
        let is_textured = described.is_some_and(|material| material.texture.is_some());
        let before = draft.outlines.len();
        add_faces(path, mesh, number, is_textured, &mut draft)?;
        if described.is_none() {
            repairs.default_reflectances += draft.outlines.len() - before;
        }
    }
    Ok(draft)
}

/// Adds the faces of one run of a material.
fn add_faces(
    path: &Path,
    mesh: &tobj::Mesh,
    material: usize,
    is_textured: bool,
    draft: &mut Draft,
) -> Result<(), ImportError> {
    let triangles = vec![3; mesh.indices.len() / 3];
    let arities = if mesh.face_arities.is_empty() {
        &triangles
    } else {
        &mesh.face_arities
    };
    let mut first = 0;
    for arity in arities {
        let end = first + *arity as usize;
        let corners = first..end;
        first = end;
        let vertices = mesh.indices.get(corners.clone()).unwrap_or_default();
        let places = mesh
            .texcoord_indices
            .get(corners)
            .filter(|_| is_textured)
            .unwrap_or_default();
        let uv: Option<Vec<Vec2>> = places.iter().map(|i| place(&mesh.texcoords, *i)).collect();
        let outline = Outline {
            material,
            vertices: vertices
                .iter()
                .filter_map(|i| vertex(&mesh.positions, *i))
                .collect(),
            uv: uv.unwrap_or_default(),
        };
        draft.add_outline(path, outline)?;
    }
    Ok(())
}

fn vertex(positions: &[f32], index: u32) -> Option<Vec3> {
    let (triples, _) = positions.as_chunks();
    triples.get(index as usize).copied().map(Vec3::from_array)
}

/// A texture coordinate, from the top; `None` for a corner without one.
fn place(coordinates: &[f32], index: u32) -> Option<Vec2> {
    let (pairs, _) = coordinates.as_chunks();
    let [u, v] = *pairs.get(index as usize)?;
    let place = Vec2::new(u, 1.0 - v);
    place.is_finite().then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{Imported, load};
    use relume::color::Rgb;

    const BOX: &str =
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

    fn import(obj: &str, mtl: Option<&str>) -> Result<Imported, ImportError> {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("s.OBJ");
        std::fs::write(&scene, obj).unwrap();
        if let Some(mtl) = mtl {
            std::fs::write(folder.path().join("m.mtl"), mtl).unwrap();
        }
        let mut texture = image::RgbImage::new(1, 2);
        texture.put_pixel(0, 0, image::Rgb([255, 255, 255]));
        texture.save(folder.path().join("top white.png")).unwrap();
        load(&scene, None)
    }

    #[test]
    fn quads_keep_order_and_vertices_and_emissive_materials_are_lights() {
        let obj = format!(
            "{BOX}v 0 0 5\nv 1 0 5\nv 1 1 5\nusemtl lamp\nf 4 3 2 1\nusemtl wall\nf 5 6 7\nusemtl lamp\nf 5 7 6\n"
        );
        let mtl = "newmtl wall\nKd 0.5 1.5 0.25\nnewmtl lamp\nKd 0 0 0\nKe 2 1 0\n";
        let Imported {
            scene,
            polygons,
            repairs,
        } = import(&obj, Some(mtl)).unwrap();
        assert_eq!(polygons, 3);
        let quad = scene.surfaces[0].polygon().vertices();
        assert_eq!(
            quad,
            [Vec3::Y, Vec3::new(1.0, 1.0, 0.0), Vec3::X, Vec3::ZERO]
        );
        assert_eq!(scene.surfaces[0].emission().unwrap().share, Rgb::WHITE);
        assert_eq!(scene.lights.len(), 1);
        assert_eq!(scene.lights[0].name, "lamp");
        assert_eq!(
            scene.lights[0].emission,
            Rgb::new(2.0, 1.0, 0.0) * std::f32::consts::PI
        );
        // The last face is the wall's place from behind: of the two, the lamp stays.
        assert_eq!((scene.surfaces.len(), repairs.duplicate_faces), (2, 1));
        assert!(
            scene
                .surfaces
                .iter()
                .all(|s| s.is_two_sided() && s.emission().is_some())
        );
    }

    #[test]
    fn missing_files_and_materials_are_counted() {
        let obj = format!("{BOX}f 1 2 3\nusemtl nobody\nf 1 3 4\n");
        for (mtl, files) in [(None, 1), (Some("newmtl other\nKd 1 1 1"), 0)] {
            let imported = import(&obj, mtl).unwrap();
            assert_eq!(imported.scene.surfaces.len(), 1);
            let grey = imported.scene.surfaces[0].reflectance().get();
            assert_eq!(grey, Rgb::splat(0.5));
            assert_eq!(imported.repairs.default_reflectances, 2);
            assert_eq!(imported.repairs.missing_material_files, files);
        }
    }

    #[test]
    fn textures_lie_as_the_file_says() {
        let obj = format!("{BOX}usemtl t\nf 1/1 2/2 3/3 4/4\n");
        let mtl = "newmtl t\nmap_Kd -clamp on top white.png\n";
        let Imported { scene, repairs, .. } = import(&obj, Some(mtl)).unwrap();
        assert_eq!(
            (repairs.textures_used, repairs.ignored_texture_options),
            (1, 1)
        );
        let texture = scene.textures[0].as_ref().unwrap();
        let lower = texture.mean_over(Vec2::ZERO, Vec2::new(1.0, 0.5)).r;
        let upper = texture.mean_over(Vec2::new(0.0, 0.5), Vec2::ONE).r;
        assert_eq!((lower, upper), (0.0, 0.98));
        assert!((scene.surfaces[0].reflectance().get().r - 0.5).abs() < 1e-6);

        let mtl = "newmtl t\nKd 0.3 0.3 0.3\nmap_Kd gone.png\n";
        let Imported { scene, repairs, .. } = import(&obj, Some(mtl)).unwrap();
        assert_eq!(repairs.missing_textures, 1);
        assert!(scene.textures[0].is_none());
        assert_eq!(scene.surfaces[0].reflectance().get(), Rgb::splat(0.3));
    }

    #[test]
    fn errors_name_file_and_place() {
        let cases = [
            (
                format!("{BOX}f 1 2 9\n"),
                "m",
                "s.OBJ, line 10: \"9\" is no vertex",
            ),
            (
                format!("{BOX}v 1 NaN 2\n"),
                "m",
                "s.OBJ, line 10: vertex (1, NaN, 2) is not finite",
            ),
            (BOX.to_owned(), "", "s.OBJ: no usable face"),
            (String::new(), "", "s.OBJ: no usable face"),
            (
                format!("{BOX}usemtl a\nf 1 2 3"),
                "newmtl a\nKd -1 0 0",
                "m.mtl, material \"a\": Kd (-1, 0, 0)",
            ),
            (
                format!("{BOX}usemtl a\nf 1 2 3"),
                "newmtl a\nKd 1 0",
                "m.mtl, line 2: `Kd` needs",
            ),
        ];
        for (obj, mtl, expected) in cases {
            let message = import(&obj, Some(mtl)).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
            assert!(!message.contains('\n'));
        }
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("latin.obj");
        std::fs::write(&scene, b"# ok\n# caf\xe9\nv 0 0 0\n").unwrap();
        let message = load(&scene, None).unwrap_err().to_string();
        assert!(message.ends_with("latin.obj, line 2: not UTF-8 text; save the file as UTF-8"));
        assert!(
            load(&folder.path().join("no.obj"), None)
                .unwrap_err()
                .to_string()
                .contains("cannot be read")
        );
        assert!(
            load(Path::new("scene.fbx"), None)
                .unwrap_err()
                .to_string()
                .contains("not a known kind")
        );
    }
}
