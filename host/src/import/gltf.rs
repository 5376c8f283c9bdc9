//! glTF 2.0 scenes, `.gltf` and `.glb`.
//!
//! The default scene (else the first) is walked node by node, parents before children, and every
//! triangle is one polygon in the order in which it is met. Triangles, strips and fans are read;
//! points and lines are skipped. Where a node's transform mirrors (negative determinant) the
//! winding is turned, so that the front stays the front (glTF 2.0, 3.7.2.1). Animation, skins and
//! morph targets are ignored: the scene stands as the nodes have it.
//!
//! Lights are the emissive materials ([`super::gltf_materials`]) and the punctual lights
//! ([`super::gltf_lights`]); nodes that share a punctual light are a group.

use std::path::Path;

use ::gltf::json;
use glam::{DMat4, DQuat, Vec2, Vec3};
use json::mesh::{Mode, Primitive, Semantic};
use json::validation::Checked;
use json::{Index, Node, Root};

use super::draft::{Draft, Outline};
use super::error::{ImportError, read as read_bytes};
use super::gltf_data::Data;
use super::gltf_file::{check_requirements, split};
use super::gltf_lights::PunctualLights;
use super::gltf_materials::{Described, Materials};
use super::repairs::Repairs;

/// What a glTF file says.
pub(super) fn read(path: &Path, repairs: &mut Repairs) -> Result<Draft, ImportError> {
    let bytes = read_bytes(path)?;
    let (text, blob) = split(path, &bytes)?;
    check_requirements(path, &text)?;
    let root = Root::from_slice(&text).map_err(|error| {
        ImportError::file(
            path,
            format_args!("no legal glTF: {error}; export it again"),
        )
    })?;
    let mut reader = Reader {
        path,
        root: &root,
        data: Data::load(path, &root, blob)?,
        materials: Materials::default(),
        lights: PunctualLights::new(&root),
        draft: Draft::default(),
        repairs,
    };
    reader.walk()?;
    Ok(reader.draft)
}

/// Walks the nodes and collects what they hold.
struct Reader<'a> {
    path: &'a Path,
    root: &'a Root,
    data: Data<'a>,
    materials: Materials,
    lights: PunctualLights<'a>,
    draft: Draft,
    repairs: &'a mut Repairs,
}

impl Reader<'_> {
    fn walk(&mut self) -> Result<(), ImportError> {
        let scene = self.root.scene.unwrap_or(Index::new(0));
        let scene = self.root.get(scene).ok_or_else(|| {
            ImportError::file(self.path, "the file has no scene; export it with one")
        })?;
        let mut visited = vec![false; self.root.nodes.len()];
        let mut stack: Vec<(Index<Node>, DMat4)> = scene
            .nodes
            .iter()
            .rev()
            .map(|node| (*node, DMat4::IDENTITY))
            .collect();
        while let Some((index, parent)) = stack.pop() {
            let Some(node) = self.root.get(index) else {
                return Err(self.node_fault(index, "does not exist; export the file again"));
            };
            let seen = visited.get_mut(index.value());
            if seen.is_some_and(|seen| std::mem::replace(seen, true)) {
                return Err(self.node_fault(index, "is met twice; nodes must form a tree"));
            }
            let transform = parent * local_transform(node);
            self.add_node(index, node, transform)?;
            let children = node.children.iter().flatten().rev();
            stack.extend(children.map(|child| (*child, transform)));
        }
        Ok(())
    }

    fn add_node(
        &mut self,
        index: Index<Node>,
        node: &Node,
        transform: DMat4,
    ) -> Result<(), ImportError> {
        if let Some(mesh) = node.mesh {
            let Some(mesh) = self.root.get(mesh) else {
                return Err(
                    self.node_fault(index, "its mesh does not exist; export the file again")
                );
            };
            for (primitive, number) in mesh.primitives.iter().zip(0..) {
                self.add_primitive(index, primitive, number, transform)?;
            }
        }
        let extensions = node.extensions.as_ref();
        if let Some(light) = extensions.and_then(|e| e.khr_lights_punctual.as_ref()) {
            let entry = self.lights.entry(light.light.value(), node, transform);
            let entry = entry.map_err(|fault| self.node_fault(index, fault))?;
            self.draft.entries.push(entry);
        }
        Ok(())
    }

    fn node_fault(&self, index: Index<Node>, fault: impl ToString) -> ImportError {
        let name = self
            .root
            .get(index)
            .and_then(|node| node.name.as_deref())
            .unwrap_or_default();
        ImportError::part(
            self.path,
            format_args!("node {} ({name:?})", index.value()),
            fault,
        )
    }

    /// Adds the triangles of a primitive.
    fn add_primitive(
        &mut self,
        node: Index<Node>,
        primitive: &Primitive,
        number: usize,
        transform: DMat4,
    ) -> Result<(), ImportError> {
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => {
                mode
            }
            _ => {
                self.repairs.skipped_points_and_lines += 1;
                return Ok(());
            }
        };
        let described = self.materials.get(
            self.path,
            &self.data,
            self.root,
            primitive.material,
            &mut self.draft,
            self.repairs,
        )?;
        if primitive
            .attributes
            .contains_key(&Checked::Valid(Semantic::Colors(0)))
        {
            self.repairs.ignored_vertex_colours += 1;
        }
        let vertices = self
            .vertices(primitive, described, transform)
            .map_err(|fault| self.node_fault(node, format_args!("primitive {number}: {fault}")))?;

        let mirrored = transform.determinant() < 0.0;
        let count = self.draft.outlines.len();
        for [a, b, c] in triangles(mode, &vertices.order) {
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            let Some(outline) = vertices.outline(corners, described.number) else {
                let fault = format!(
                    "primitive {number}: a triangle names vertices {a}, {b}, {c} of {}; export the \
                     file again",
                    vertices.positions.len()
                );
                return Err(self.node_fault(node, fault));
            };
            self.draft.add_outline(self.path, outline)?;
        }
        if primitive.material.is_none() {
            self.repairs.default_reflectances += self.draft.outlines.len() - count;
        }
        Ok(())
    }

    /// The vertices of a primitive in the scene's coordinates.
    fn vertices(
        &self,
        primitive: &Primitive,
        described: Described,
        transform: DMat4,
    ) -> Result<Vertices, String> {
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let positions = attribute(Semantic::Positions).ok_or("has no positions")?;
        let positions: Vec<Vec3> = self
            .data
            .vectors::<3>(positions)?
            .into_iter()
            .map(|position| {
                transform
                    .transform_point3(Vec3::from(position).as_dvec3())
                    .as_vec3()
            })
            .collect();
        if let Some(vertex) = positions.iter().position(|position| !position.is_finite()) {
            return Err(format!(
                "vertex {vertex} is not finite; correct it or the transform"
            ));
        }

        let mut uv = None;
        if let Some(placement) = described.placement
            && let Some(places) = attribute(Semantic::TexCoords(placement.set))
        {
            let places = self.data.vectors::<2>(places)?;
            uv = places
                .into_iter()
                .map(|place| placement.apply(place))
                .collect();
        }
        let order = match primitive.indices {
            Some(indices) => self.data.indices(indices)?,
            None => (0..).take(positions.len()).collect(),
        };
        Ok(Vertices {
            positions,
            uv,
            order,
        })
    }
}

/// Vertices of a primitive, and the order in which it names them.
struct Vertices {
    positions: Vec<Vec3>,
    uv: Option<Vec<Vec2>>,
    order: Vec<u32>,
}

impl Vertices {
    /// A triangle; `None` when it names a vertex that does not exist.
    fn outline(&self, corners: [u32; 3], material: usize) -> Option<Outline> {
        let corners = corners.map(|corner| corner as usize);
        let vertices = corners
            .iter()
            .map(|i| self.positions.get(*i).copied())
            .collect::<Option<_>>()?;
        let place = |i: &usize| self.uv.as_ref()?.get(*i).copied();
        Some(Outline {
            material,
            vertices,
            uv: corners
                .iter()
                .map(place)
                .collect::<Option<_>>()
                .unwrap_or_default(),
        })
    }
}

/// The triangles of a list, a strip or a fan, wound alike (glTF 2.0, 3.7.2.1).
fn triangles(mode: Mode, order: &[u32]) -> Vec<[u32; 3]> {
    let windows = order
        .windows(3)
        .filter_map(|window| <[u32; 3]>::try_from(window).ok());
    match mode {
        Mode::TriangleStrip => {
            let turned =
                |([a, b, c], i): ([u32; 3], usize)| if i % 2 == 0 { [a, b, c] } else { [a, c, b] };
            windows.zip(0..).map(turned).collect()
        }
        Mode::TriangleFan => {
            let Some((hub, rim)) = order.split_first() else {
                return Vec::new();
            };
            rim.iter()
                .zip(rim.iter().skip(1))
                .map(|(b, c)| [*b, *c, *hub])
                .collect()
        }
        _ => order.as_chunks().0.to_vec(),
    }
}

/// Transform of a node relative to its parent.
fn local_transform(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let vector = |value: Option<[f32; 3]>, or: f32| Vec3::from(value.unwrap_or([or; 3])).as_dvec3();
    let [x, y, z, w] = node.rotation.unwrap_or_default().0.map(f64::from);
    DMat4::from_scale_rotation_translation(
        vector(node.scale, 1.0),
        DQuat::from_xyzw(x, y, z, w).normalize(),
        vector(node.translation, 0.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{Imported, load};
    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;
    use relume::color::Rgb;
    use relume::scene::{Falloff, Source, Surface};

    /// A unit square: positions, texture coordinates, indices of two triangles.
    fn square() -> Vec<u8> {
        let corners: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let positions = corners.iter().flat_map(|[x, y]| [*x, *y, 0.0]);
        let places = corners.iter().flatten().copied();
        let indices: [u16; 6] = [0, 1, 2, 0, 2, 3];
        let numbers = positions.chain(places).flat_map(f32::to_le_bytes);
        numbers
            .chain(indices.into_iter().flat_map(u16::to_le_bytes))
            .collect()
    }

    /// A file with the square as accessors 0 to 2 and the given other parts.
    fn document(parts: &str) -> String {
        let data = STANDARD.encode(square());
        format!(
            r#"{{"asset":{{"version":"2.0"}},
            "buffers":[{{"byteLength":92,"uri":"data:application/octet-stream;base64,{data}"}}],
            "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":32}},
                {{"buffer":0,"byteOffset":80,"byteLength":12}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
                {{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"}},
                {{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}}],{parts}}}"#
        )
    }

    fn import_text(text: &str) -> Result<Imported, ImportError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.gltf");
        std::fs::write(&path, text).unwrap();
        load(&path, None)
    }

    fn import(parts: &str) -> Result<Imported, ImportError> {
        import_text(&document(parts))
    }

    const SQUARE_MESH: &str =
        r#"{"primitives":[{"attributes":{"POSITION":0},"indices":2,"material":0}]}"#;

    fn normal(surface: &Surface) -> Vec3 {
        surface.polygon().normal()
    }

    #[test]
    fn transforms_apply_down_the_tree_and_mirrors_keep_the_front() {
        let parts = format!(
            r#""scenes":[{{"nodes":[2]}},{{"nodes":[0]}}],"scene":1,"meshes":[{SQUARE_MESH}],
            "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[0.2,0.3,0.4,1]}}}}],
            "nodes":[{{"translation":[0,0,5],"rotation":[0.70710678,0,0,0.70710678],"children":[1,3]}},
                {{"mesh":0,"scale":[2,3,1]}},{{"mesh":0}},{{"mesh":0,"scale":[-1,1,1]}}]"#
        );
        let Imported {
            scene,
            polygons,
            repairs,
        } = import(&parts).unwrap();
        assert_eq!(
            (polygons, scene.surfaces.len(), repairs.recovered_quads),
            (4, 2, 2)
        );
        assert_eq!(repairs.ignored_metallic, 1);
        let [large, mirrored] = &*scene.surfaces else {
            panic!()
        };
        let expected = [
            [0.0, 0.0, 5.0],
            [2.0, 0.0, 5.0],
            [2.0, 0.0, 8.0],
            [0.0, 0.0, 8.0],
        ];
        for (vertex, expected) in large.polygon().vertices().iter().zip(expected) {
            assert!(vertex.distance(Vec3::from(expected)) < 1e-5, "{vertex}");
        }
        assert!(normal(large).distance(-Vec3::Y) < 1e-5);
        assert!(normal(mirrored).distance(-Vec3::Y) < 1e-5);
        assert!(mirrored.polygon().vertices().iter().all(|v| v.x <= 1e-6));
        assert_eq!(large.reflectance().get(), Rgb::new(0.2, 0.3, 0.4));
        assert!(!large.is_two_sided());
    }

    #[test]
    fn strips_fans_and_lists_are_wound_alike_and_lines_are_skipped() {
        assert_eq!(
            triangles(Mode::TriangleStrip, &[0, 1, 2, 3]),
            [[0, 1, 2], [1, 3, 2]]
        );
        assert_eq!(
            triangles(Mode::TriangleFan, &[0, 1, 2, 3]),
            [[1, 2, 0], [2, 3, 0]]
        );
        assert_eq!(triangles(Mode::Triangles, &[0, 1, 2, 3, 4]), [[0, 1, 2]]);
        assert!(triangles(Mode::TriangleFan, &[]).is_empty());
        let parts = r#""scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":[
            {"attributes":{"POSITION":0},"mode":6},{"attributes":{"POSITION":0},"mode":1},
            {"attributes":{"POSITION":0,"COLOR_0":0},"mode":5}]}]"#;
        let Imported { scene, repairs, .. } = import(parts).unwrap();
        // The fan is the square; the strip repeats one of its halves and adds a crossing one.
        assert_eq!((scene.surfaces.len(), repairs.duplicate_faces), (2, 1));
        assert_eq!(
            (
                repairs.skipped_points_and_lines,
                repairs.ignored_vertex_colours
            ),
            (1, 1)
        );
        assert_eq!(repairs.default_reflectances, 4);
        assert_eq!(scene.surfaces[0].reflectance().get(), Rgb::splat(0.5));
        assert_eq!(normal(&scene.surfaces[0]), Vec3::Z);
    }

    #[test]
    fn emissive_materials_and_textures() {
        let mut png = std::io::Cursor::new(Vec::new());
        let mut picture = image::RgbImage::new(2, 1);
        picture.put_pixel(1, 0, image::Rgb([255, 0, 255]));
        picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let png = STANDARD.encode(png.get_ref());
        let primitive = |material: usize| {
            format!(
                r#"{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"indices":2,"material":{material}}}"#
            )
        };
        let parts = format!(
            r#""scenes":[{{"nodes":[0,1]}}],"nodes":[{{"mesh":0}},{{"mesh":1,"translation":[0,0,2]}}],
            "meshes":[{{"primitives":[{}]}},{{"primitives":[{}]}}],
            "images":[{{"uri":"data:image/png;base64,{png}"}},{{"uri":"gone.png"}}],
            "textures":[{{"source":0}},{{"source":1}}],
            "materials":[{{"doubleSided":true,"emissiveFactor":[1,0.5,0.25],"emissiveTexture":{{"index":0}},
                "extensions":{{"KHR_materials_emissive_strength":{{"emissiveStrength":8}}}},
                "pbrMetallicRoughness":{{"metallicFactor":0,"baseColorTexture":{{"index":1}}}}}},
                {{"name":"tiles","pbrMetallicRoughness":{{"metallicFactor":0,"baseColorFactor":[0.5,1,1,1],
                "baseColorTexture":{{"index":0,"extensions":{{"KHR_texture_transform":{{"scale":[0.5,1]}}}}}}}}}}]"#,
            primitive(0),
            primitive(1)
        );
        let Imported { scene, repairs, .. } = import(&parts).unwrap();
        assert_eq!(scene.lights.len(), 1);
        assert_eq!(scene.lights[0].name, "light_material_0");
        let exitance = Rgb::new(4.0, 0.0, 1.0) * std::f32::consts::PI;
        assert_eq!(scene.lights[0].emission, exitance);
        assert!(scene.surfaces[0].is_two_sided() && scene.surfaces[0].emission().is_some());
        assert_eq!(repairs.clamped_reflectances, 1);
        assert_eq!(
            (repairs.missing_textures, repairs.averaged_emissive_textures),
            (1, 1)
        );
        assert_eq!((repairs.textures_used, repairs.ignored_metallic), (1, 0));
        // The transform leaves only the black half of the image.
        assert_eq!(scene.surfaces[1].reflectance().get(), Rgb::BLACK);
        let texture = scene.textures[1].as_ref().unwrap();
        assert_eq!(
            (texture.corners.len(), texture.corners[2]),
            (4, Vec2::new(0.5, 1.0))
        );
    }

    #[test]
    fn punctual_lights_are_named_placed_and_grouped() {
        let parts = format!(
            r#""scenes":[{{"nodes":[0,1,2,3,4]}}],"meshes":[{SQUARE_MESH}],"materials":[{{}}],
            "extensions":{{"KHR_lights_punctual":{{"lights":[
                {{"type":"point","color":[1,0.5,0],"intensity":10,"range":3}},
                {{"type":"spot","name":"beam","spot":{{"innerConeAngle":0.2,"outerConeAngle":0.5}}}},
                {{"type":"directional","intensity":3}}]}}}},
            "nodes":[{{"mesh":0}},
                {{"name":"bulb","translation":[1,2,3],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},
                {{"rotation":[-0.70710678,0,0,0.70710678],"scale":[2,2,2],
                  "extensions":{{"KHR_lights_punctual":{{"light":1}}}}}},
                {{"translation":[4,5,6],"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},
                {{"extensions":{{"KHR_lights_punctual":{{"light":2}}}}}}]"#
        );
        let scene = import(&parts).unwrap().scene;
        let lights: Vec<_> = scene
            .lights
            .iter()
            .map(|l| (l.name.as_str(), l.emission.to_array()))
            .collect();
        let expected = [
            ("bulb", [10.0, 5.0, 0.0]),
            ("beam", [1.0; 3]),
            ("light_2", [3.0; 3]),
        ];
        assert_eq!(lights, expected);
        let tags: Vec<u32> = scene.luminaires.iter().map(|l| l.light()).collect();
        assert_eq!(tags, [0, 1, 0, 2]);
        assert_eq!(
            scene.luminaires[2].source(),
            &Source::Point {
                position: Vec3::new(4.0, 5.0, 6.0)
            }
        );
        assert_eq!(scene.luminaires[2].share(), Rgb::new(1.0, 1.0, 0.0));
        let Source::Spot {
            direction,
            inner,
            outer,
            falloff,
            ..
        } = *scene.luminaires[1].source()
        else {
            panic!();
        };
        assert!(direction.distance(-Vec3::Y) < 1e-6, "{direction}");
        assert_eq!((inner, outer, falloff), (0.2, 0.5, Falloff::Smooth));
        assert_eq!(
            scene.luminaires[3].source(),
            &Source::Sun {
                direction: -Vec3::Z,
                angle: 0.0
            }
        );
    }

    #[test]
    fn faults_name_file_place_and_remedy() {
        let scene = |nodes: &str| {
            format!(
                r#""scenes":[{{"nodes":[0]}}],"materials":[{{}}],"meshes":[{SQUARE_MESH}],"nodes":[{nodes}]"#
            )
        };
        let light = r#"{"mesh":0,"extensions":{"KHR_lights_punctual":{"light":0}}}"#;
        let with_light = |light_source: &str| {
            let extensions =
                format!(r#""extensions":{{"KHR_lights_punctual":{{"lights":[{light_source}]}}}}"#);
            format!("{},{extensions}", scene(light))
        };
        let cases = [
            (
                scene(r#"{"name":"a","mesh":0,"children":[0]}"#),
                "node 0 (\"a\"): is met twice",
            ),
            (
                scene(r#"{"children":[7]}"#),
                "node 7 (\"\"): does not exist",
            ),
            (
                scene(r#"{"mesh":7}"#),
                "node 0 (\"\"): its mesh does not exist",
            ),
            (
                scene(r#"{"mesh":0,"scale":[1e30,1e30,1e30]}"#),
                "vertex (1e30, 0e0, 0e0) is too far away; scale the scene down",
            ),
            (
                scene(r#"{"scale":[1e38,1,1],"children":[1]},{"mesh":0,"scale":[1e38,1,1]}"#),
                "node 1 (\"\"): primitive 0: vertex 1 is not finite",
            ),
            (
                scene(r#"{"mesh":0,"scale":[1e99,1,1]}"#),
                "no legal glTF: number out of range",
            ),
            (
                scene(r#"{"mesh":0,"rotation":[0,0,0,0]}"#),
                "vertex 0 is not finite",
            ),
            (scene(r#"{"mesh":0,"scale":[0,0,0]}"#), "no usable face"),
            (scene("{}"), "no usable face"),
            (scene(light), "light 0 does not exist"),
            (
                with_light(r#"{"type":"point","intensity":-1}"#),
                "make it zero or more",
            ),
            (with_light(r#"{"type":"laser"}"#), "has no type or no cone"),
            (with_light(r#"{"type":"spot"}"#), "has no type or no cone"),
            (
                with_light(r#"{"type":"spot","spot":{"innerConeAngle":1,"outerConeAngle":0.5}}"#),
                "0 <= inner <= outer",
            ),
            (
                scene(r#"{"mesh":0}"#).replace("\"materials\":[{}]", "\"materials\":[]"),
                "material 0 (\"\"): does not exist",
            ),
            (
                scene(r#"{"mesh":0}"#).replace(
                    "[{}]",
                    r#"[{"name":"m","pbrMetallicRoughness":{"baseColorFactor":[1,-1,1,1]}}]"#,
                ),
                "material 0 (\"m\"): baseColorFactor (1, -1, 1) is negative",
            ),
            (
                scene(r#"{"mesh":0}"#).replace("\"indices\":2", "\"indices\":9"),
                "primitive 0: accessor 9 does not exist",
            ),
            (
                scene(r#"{"mesh":0}"#).replace("\"scenes\"", "\"x\""),
                "has no scene",
            ),
            (
                format!(
                    r#"{},"extensionsRequired":["KHR_draco_mesh_compression","KHR_materials_unlit"]"#,
                    scene("{}")
                ),
                "not supported: \"KHR_draco_mesh_compression\"; export",
            ),
        ];
        for (parts, expected) in cases {
            let message = import(&parts).unwrap_err().to_string();
            assert!(
                message.contains("s.gltf") && message.contains(expected),
                "{message}"
            );
            assert!(!message.contains('\n'), "{message}");
        }
        let cut = document(&scene(r#"{"mesh":0}"#)).replace("\"count\":4", "\"count\":3");
        let message = import_text(&cut).unwrap_err().to_string();
        assert!(
            message.contains("a triangle names vertices 0, 2, 3 of 3"),
            "{message}"
        );
        let old = document(&scene("{}")).replace("2.0", "1.1");
        assert!(
            import_text(&old)
                .unwrap_err()
                .to_string()
                .contains("glTF version \"1.1\"")
        );
        assert!(
            import_text("{")
                .unwrap_err()
                .to_string()
                .contains("no legal glTF")
        );
        let unlit = format!(
            r#"{},"extensionsRequired":["KHR_materials_unlit"]"#,
            scene(r#"{"mesh":0}"#)
        );
        assert!(import(&unlit).is_ok());
    }
}
