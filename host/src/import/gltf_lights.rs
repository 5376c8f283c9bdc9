//! Punctual lights of a glTF file (KHR_lights_punctual).
//!
//! The name of a light is its own, else that of the first node that has it, else `light_N`. The
//! emission is colour times intensity; `range` is ignored. A spot or sun shines along the node's
//! -Z; scale changes neither its cone nor its strength.

use ::gltf::json;
use glam::{DMat4, DVec3};
use json::extensions::scene::khr_lights_punctual::{Light, Type};
use json::validation::Checked;
use json::{Node, Root};
use relume::color::Rgb;
use relume::scene::{Falloff, Luminaire, Source};

use super::draft::{Emitter, Entry};

/// The punctual lights that nodes refer to.
#[derive(Debug)]
pub(super) struct PunctualLights<'a> {
    lights: &'a [Light],
    /// Their names, once a node has them.
    names: Vec<Option<String>>,
}

impl<'a> PunctualLights<'a> {
    pub fn new(root: &'a Root) -> Self {
        let lights: &[Light] = root.as_ref();
        Self {
            lights,
            names: vec![None; lights.len()],
        }
    }

    /// The light with a number, where a node has it.
    ///
    /// # Errors
    /// A light that does not exist or that cannot shine.
    pub fn entry(&mut self, number: usize, node: &Node, transform: DMat4) -> Result<Entry, String> {
        let missing = || format!("light {number} does not exist; export the file again");
        let light = self.lights.get(number).ok_or_else(missing)?;
        let name = self.names.get_mut(number).ok_or_else(missing)?;
        let given = |name: &Option<String>| name.clone().filter(|name| !name.is_empty());
        let name = name.get_or_insert_with(|| {
            let own = given(&light.name).or_else(|| given(&node.name));
            own.unwrap_or_else(|| format!("light_{number}"))
        });

        let [r, g, b] = light.color.map(|channel| channel * light.intensity);
        let emission = Rgb::new(r, g, b);
        if !emission.is_legal() {
            return Err(format!(
                "light {name:?} has colour times intensity ({r}, {g}, {b}); make it zero or more"
            ));
        }
        let source = source(light, transform)
            .ok_or_else(|| format!("light {name:?} has no type or no cone; export it again"))?;
        let luminaire = Luminaire::new(0, Rgb::WHITE, source)
            .map_err(|fault| format!("light {name:?}: {fault}; correct it or the transform"))?;
        Ok(Entry {
            name: name.clone(),
            emission,
            importance: 1.0,
            emitter: Emitter::Source(*luminaire.source()),
        })
    }
}

/// What shines, in the scene's coordinates; `None` for an unknown type or a spot without a cone.
fn source(light: &Light, transform: DMat4) -> Option<Source> {
    let position = transform.w_axis.truncate().as_vec3();
    let direction = transform.transform_vector3(DVec3::NEG_Z).as_vec3();
    Some(match (light.type_, &light.spot) {
        (Checked::Valid(Type::Point), _) => Source::Point { position },
        (Checked::Valid(Type::Directional), _) => Source::Sun {
            direction,
            angle: 0.0,
        },
        (Checked::Valid(Type::Spot), Some(spot)) => Source::Spot {
            position,
            direction,
            inner: spot.inner_cone_angle,
            outer: spot.outer_cone_angle,
            falloff: Falloff::Smooth,
        },
        _ => return None,
    })
}
