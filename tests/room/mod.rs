//! A room of 4 x 2.5 x 3 m with a free-standing screen, a ceiling panel and a coloured sconce, as
//! OBJ and as GLB.

use serde_json::json;

type Vector = [f32; 3];

/// Linear reflectance and radiance of the materials.
const MATERIALS: [(&str, Vector, Vector); 6] = [
    ("white", [0.75, 0.74, 0.7], [0.0; 3]),
    ("red", [0.6, 0.1, 0.08], [0.0; 3]),
    ("blue", [0.1, 0.2, 0.5], [0.0; 3]),
    ("wood", [0.4, 0.25, 0.1], [0.0; 3]),
    ("ceiling", [0.0; 3], [4.0, 3.5, 3.0]),
    ("sconce", [0.0; 3], [1.0, 2.0, 3.0]),
];

/// Quads, fronts counter-clockwise; the walls face inwards.
const QUADS: [(&str, [Vector; 4]); 9] = [
    (
        "wood",
        [[0., 0., 0.], [0., 0., 3.], [4., 0., 3.], [4., 0., 0.]],
    ),
    (
        "white",
        [[0., 2.5, 0.], [4., 2.5, 0.], [4., 2.5, 3.], [0., 2.5, 3.]],
    ),
    (
        "white",
        [[0., 0., 0.], [4., 0., 0.], [4., 2.5, 0.], [0., 2.5, 0.]],
    ),
    (
        "white",
        [[0., 0., 3.], [0., 2.5, 3.], [4., 2.5, 3.], [4., 0., 3.]],
    ),
    (
        "red",
        [[0., 0., 0.], [0., 2.5, 0.], [0., 2.5, 3.], [0., 0., 3.]],
    ),
    (
        "blue",
        [[4., 0., 0.], [4., 0., 3.], [4., 2.5, 3.], [4., 2.5, 0.]],
    ),
    (
        "white",
        [
            [2.75, 0., 0.5],
            [2.75, 0., 2.0],
            [2.75, 1.5, 2.0],
            [2.75, 1.5, 0.5],
        ],
    ),
    (
        "ceiling",
        [
            [1.5, 2.45, 1.],
            [2.5, 2.45, 1.],
            [2.5, 2.45, 2.],
            [1.5, 2.45, 2.],
        ],
    ),
    (
        "sconce",
        [
            [0.05, 1.5, 1.6],
            [0.05, 1.5, 1.4],
            [0.05, 1.8, 1.4],
            [0.05, 1.8, 1.6],
        ],
    ),
];

/// Names of the two lights, and their nominal emissions: pi times the radiance.
pub const LIGHTS: [&str; 2] = ["ceiling", "sconce"];

/// A point light, as the GLB has it and as a light file says it.
pub const BULB: &str = "[[light]]\nname = 'bulb'\nkind = 'point'\nposition = [1.25, 2.0, 1.25]\n\
    emission = [5.0, 2.5, 1.25]\n";

/// Points on the room's surfaces, away from the edges of elements.
pub const POINTS: &str = "x,y,z,nx,ny,nz\n\
    1.3,0,1.3,0,1,0\n3.6,0,1.2,0,1,0\n0.3,2.5,2.7,0,-1,0\n2.1,1.1,0,0,0,1\n3.7,0.2,3,0,0,-1\n\
    0,0.8,0.7,1,0,0\n4,1.7,1.9,-1,0,0\n2.75,0.7,1.3,1,0,0\n2.75,0.7,1.3,-1,0,0\n";

/// The material library.
pub fn mtl() -> String {
    let lines = MATERIALS.map(|(name, [r, g, b], [x, y, z])| {
        format!("newmtl {name}\nKd {r} {g} {b}\nKe {x} {y} {z}\n")
    });
    lines.concat()
}

/// The scene, which names `room.mtl`; `flipped` turns every wall round.
pub fn obj(flipped: bool) -> String {
    let mut text = "mtllib room.mtl\n".to_owned();
    for (number, (material, vertices)) in QUADS.iter().enumerate() {
        for [x, y, z] in vertices {
            text += &format!("v {x} {y} {z}\n");
        }
        let order = if flipped && !LIGHTS.contains(material) {
            [4, 3, 2, 1]
        } else {
            [1, 2, 3, 4]
        };
        let [a, b, c, d] = order.map(|corner| 4 * number + corner);
        text += &format!("usemtl {material}\nf {a} {b} {c} {d}\n");
    }
    text
}

/// The same with the bulb as a binary glTF: triangles, one primitive per material, and a node that
/// moves the whole room into its place.
pub fn glb() -> Vec<u8> {
    const MOVED: Vector = [10.0, -3.0, 0.5];
    let mut binary: Vec<u8> = Vec::new();
    let (mut views, mut accessors, mut primitives) = (Vec::new(), Vec::new(), Vec::new());
    for (material, (name, ..)) in MATERIALS.iter().enumerate() {
        let quads = QUADS.iter().filter(|quad| quad.0 == *name);
        let corners: Vec<Vector> = quads
            .flat_map(|(_, v)| [v[0], v[1], v[2], v[0], v[2], v[3]])
            .map(|v| [v[0] - MOVED[0], v[1] - MOVED[1], v[2] - MOVED[2]])
            .collect();
        let (start, length) = (binary.len(), corners.len() * 12);
        let bytes = corners.iter().flatten().flat_map(|v| v.to_le_bytes());
        binary.extend(bytes);
        let bound = |pick: fn(f32, f32) -> f32| {
            let pick = |a: Vector, b: &Vector| [0, 1, 2].map(|axis| pick(a[axis], b[axis]));
            corners.iter().fold(corners[0], pick)
        };
        views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": length}));
        accessors.push(json!({
            "bufferView": material, "componentType": 5126, "type": "VEC3",
            "count": corners.len(), "min": bound(f32::min), "max": bound(f32::max),
        }));
        primitives.push(json!({"attributes": {"POSITION": material}, "material": material}));
    }
    let materials = MATERIALS.map(|(name, [r, g, b], radiance)| {
        let strength = radiance.into_iter().fold(0.0, f32::max);
        let factor = radiance.map(|v| if strength > 0.0 { v / strength } else { 0.0 });
        json!({
            "name": name, "doubleSided": true, "emissiveFactor": factor,
            "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0},
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": strength}},
        })
    });
    let document = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"name": "bulb", "type": "point", "intensity": 5.0, "color": [1.0, 0.5, 0.25]},
        ]}},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"mesh": 0, "translation": MOVED},
            {"translation": [1.25, 2.0, 1.25], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        ],
        "meshes": [{"primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": binary.len()}],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');

    let mut glb = b"glTF".to_vec();
    let total = 12 + 8 + text.len() + 8 + binary.len();
    glb.extend([2, total as u32].map(u32::to_le_bytes).concat());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}
