//! Light files: lights that are added to a scene or take the place of its nominal emissions.
//!
//! A TOML file of `[[light]]` entries. An entry whose name the scene already has replaces the
//! nominal emission (and importance, if given) of that light; a place of its own is then ignored,
//! with a count. Any other entry adds a luminaire; entries that share a name share a tag. Nothing
//! else is removed.
//!
//! Kinds and their keys: `area` (`polygon`, `reflectance`), `point` (`position`), `spot`
//! (`position`, `direction`, `inner`, `outer`, `falloff`), `sun` (`direction`, `angle`), `sky`.
//! `emission` is required for a new light; `inner` is 0 and `outer` pi/4 unless given, as in
//! KHR_lights_punctual. The polygon of an area light must be one that the solver takes; it emits
//! from the side where its vertices run counter-clockwise and reflects on both.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::Vec3;
use relume::color::Rgb;
use relume::geometry::Polygon;
use relume::scene::{self, Luminaire, Source};
use serde::Deserialize;

use super::draft::{Draft, Emitter, Entry, Glow, Material, Outline, Replacement, check_reach};
use super::error::{ImportError, read_text};
use super::repairs::Repairs;

/// Most entries of a file, so that a runaway one does not fill the memory.
const MOST_ENTRIES: usize = 262_144;

/// Names that an error message lists at most.
const NAMES_SHOWN: usize = 8;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    light: Vec<toml::Value>,
}

/// One `[[light]]` as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    name: String,
    kind: Option<Kind>,
    emission: Option<Channels>,
    importance: Option<f32>,
    position: Option<Vec3Array>,
    direction: Option<Vec3Array>,
    inner: Option<f32>,
    outer: Option<f32>,
    falloff: Option<Falloff>,
    polygon: Option<Vec<Vec3Array>>,
    reflectance: Option<Channels>,
    angle: Option<f32>,
}

type Vec3Array = [f32; 3];

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Area,
    Point,
    Spot,
    Sun,
    Sky,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Falloff {
    Smooth,
    Linear,
}

/// `0.5` or `[r, g, b]`.
#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "expected a number or three numbers [r, g, b]")]
enum Channels {
    Grey(f32),
    Rgb([f32; 3]),
}

impl Channels {
    fn legal(self, key: &str) -> Result<Rgb, String> {
        let value = match self {
            Self::Grey(grey) => Rgb::splat(grey),
            Self::Rgb(rgb) => Rgb::from_array(rgb),
        };
        if value.is_legal() {
            return Ok(value);
        }
        let Rgb { r, g, b } = value;
        Err(format!(
            "`{key}` ({r}, {g}, {b}) must be numbers of zero or more"
        ))
    }
}

/// Applies the light file at `path` to what the scene file said.
///
/// # Errors
/// The first entry that is wrong, by number (from 1) and name.
pub(super) fn apply(
    path: &Path,
    draft: &mut Draft,
    repairs: &mut Repairs,
) -> Result<(), ImportError> {
    let text = read_text(path)?;
    let entries = text
        .lines()
        .filter(|line| line.trim_start().starts_with("[[light]]"))
        .count();
    if entries > MOST_ENTRIES {
        let fault =
            format!("{entries} lights; at most {MOST_ENTRIES} entries are handled, use fewer");
        return Err(ImportError::file(path, fault));
    }
    let file: File = toml::from_str(&text).map_err(|error| syntax_error(path, &text, &error))?;

    let scene: HashSet<String> = draft
        .entries
        .iter()
        .map(|entry| entry.name.clone())
        .collect();
    let mut replaced: HashMap<String, usize> = HashMap::new();
    for (value, number) in file.light.into_iter().zip(1..) {
        let name = value
            .get("name")
            .and_then(toml::Value::as_str)
            .unwrap_or_default()
            .to_owned();
        let fault = |fault: String| {
            ImportError::part(path, format_args!("light {number} ({name:?})"), fault)
        };
        let written: Written = value
            .try_into()
            .map_err(|error: toml::de::Error| fault(first_line(error.message())))?;
        written.check().map_err(fault)?;
        if scene.contains(&written.name) {
            if let Some(earlier) = replaced.insert(written.name.clone(), number) {
                return Err(fault(format!(
                    "light {earlier} replaces the same light of the scene; keep one of the two"
                )));
            }
            repairs.ignored_light_geometry += usize::from(written.has_place());
            draft
                .replacements
                .push(written.replacement().map_err(fault)?);
        } else {
            written.add_to(draft, &scene).map_err(fault)?;
        }
    }
    Ok(())
}

/// What the TOML parser says, with the line.
fn syntax_error(path: &Path, text: &str, error: &toml::de::Error) -> ImportError {
    let start = error.span().map_or(0, |span| span.start);
    let before = text.as_bytes().iter().take(start);
    let line = 1 + before.filter(|byte| **byte == b'\n').count();
    ImportError::line(path, line, first_line(error.message()))
}

fn first_line(message: &str) -> String {
    message.lines().collect::<Vec<_>>().join(", ")
}

impl Written {
    /// Checks what every entry has.
    fn check(&self) -> Result<(), String> {
        if self.name.is_empty() {
            return Err("the name is empty; give the light one".to_owned());
        }
        let importance = self.importance.unwrap_or(1.0);
        if !(importance > 0.0 && importance.is_finite()) {
            return Err(format!(
                "`importance` {importance} must be a number above zero"
            ));
        }
        self.emission().map(drop)
    }

    fn emission(&self) -> Result<Option<Rgb>, String> {
        self.emission
            .map(|emission| emission.legal("emission"))
            .transpose()
    }

    /// True when the entry says where a light is.
    fn has_place(&self) -> bool {
        let other_kind = self.kind.is_some_and(|kind| kind != Kind::Area);
        other_kind || self.given().iter().any(|(_, given, _)| *given)
    }

    /// The keys that belong to some kinds only: name, whether it is there, the kinds.
    fn given(&self) -> [(&'static str, bool, &'static [Kind]); 8] {
        use Kind::{Area, Point, Spot, Sun};
        [
            ("position", self.position.is_some(), &[Point, Spot]),
            ("direction", self.direction.is_some(), &[Spot, Sun]),
            ("inner", self.inner.is_some(), &[Spot]),
            ("outer", self.outer.is_some(), &[Spot]),
            ("falloff", self.falloff.is_some(), &[Spot]),
            ("polygon", self.polygon.is_some(), &[Area]),
            ("reflectance", self.reflectance.is_some(), &[Area]),
            ("angle", self.angle.is_some(), &[Sun]),
        ]
    }

    fn replacement(&self) -> Result<Replacement, String> {
        Ok(Replacement {
            name: self.name.clone(),
            emission: self.emission()?,
            importance: self.importance,
        })
    }

    /// Adds a new light; `scene` holds the names of those that it has.
    fn add_to(self, draft: &mut Draft, scene: &HashSet<String>) -> Result<(), String> {
        let kind = self.kind.ok_or_else(|| no_such_light(scene))?;
        let stray = self
            .given()
            .into_iter()
            .find(|(_, given, kinds)| *given && !kinds.contains(&kind));
        if let Some((key, ..)) = stray {
            return Err(format!("{} has no `{key}`; remove it", kind.with_article()));
        }
        let emission = self.emission()?.ok_or("needs an `emission = [r, g, b]`")?;
        let emitter = match self.source(kind)? {
            Some(source) => Emitter::Source(source),
            None => Emitter::Material(self.add_surface(draft, emission)?),
        };
        draft.entries.push(Entry {
            name: self.name,
            emission,
            importance: self.importance.unwrap_or(1.0),
            emitter,
        });
        Ok(())
    }

    /// The checked source; `None` for an area light.
    fn source(&self, kind: Kind) -> Result<Option<Source>, String> {
        let need = |key: &str, value: Option<Vec3Array>| {
            let needs = || format!("{} needs `{key} = [x, y, z]`", kind.with_article());
            value.map(Vec3::from).ok_or_else(needs)
        };
        let source = match kind {
            Kind::Area => return Ok(None),
            Kind::Point => Source::Point {
                position: need("position", self.position)?,
            },
            Kind::Spot => Source::Spot {
                position: need("position", self.position)?,
                direction: need("direction", self.direction)?,
                inner: self.inner.unwrap_or(0.0),
                outer: self.outer.unwrap_or(std::f32::consts::FRAC_PI_4),
                falloff: match self.falloff {
                    Some(Falloff::Linear) => scene::Falloff::Linear,
                    Some(Falloff::Smooth) | None => scene::Falloff::Smooth,
                },
            },
            Kind::Sun => Source::Sun {
                direction: need("direction", self.direction)?,
                angle: self.angle.unwrap_or(0.0),
            },
            Kind::Sky => Source::Sky,
        };
        let luminaire = Luminaire::new(0, Rgb::WHITE, source).map_err(|fault| fault.to_string())?;
        Ok(Some(*luminaire.source()))
    }

    /// Adds the polygon of an area light and returns the number of its material.
    fn add_surface(&self, draft: &mut Draft, emission: Rgb) -> Result<usize, String> {
        let polygon = self.polygon.as_ref();
        let polygon = polygon.ok_or("an area light needs `polygon = [[x, y, z], ...]`")?;
        let vertices: Vec<Vec3> = polygon.iter().copied().map(Vec3::from).collect();
        check_reach(&vertices).map_err(|fault| format!("`polygon`: {fault}"))?;
        Polygon::new(&vertices).map_err(|fault| format!("`polygon`: {fault}"))?;
        let reflectance = self
            .reflectance
            .unwrap_or(Channels::Grey(0.0))
            .legal("reflectance")?;
        let material = draft.add_material(Material {
            reflectance,
            texture: None,
            two_sided: true,
            glow: Some(Glow {
                light: self.name.clone(),
                exitance: emission,
            }),
        });
        draft.outlines.push(Outline {
            material,
            vertices,
            uv: Vec::new(),
        });
        Ok(material)
    }
}

impl Kind {
    const fn with_article(self) -> &'static str {
        match self {
            Self::Area => "an area light",
            Self::Point => "a point light",
            Self::Spot => "a spot light",
            Self::Sun => "a sun",
            Self::Sky => "a sky",
        }
    }
}

/// An entry without a kind must name a light of the scene.
fn no_such_light(scene: &HashSet<String>) -> String {
    let mut names: Vec<String> = scene.iter().map(|name| format!("{name:?}")).collect();
    names.sort_unstable();
    let more = if names.len() > NAMES_SHOWN {
        ", ..."
    } else {
        ""
    };
    names.truncate(NAMES_SHOWN);
    format!(
        "the scene has no light of that name (it has: {}{more}); correct it, or add a light with \
         `kind` area, point, spot, sun or sky",
        names.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{Imported, load};

    const SCENE: &str = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
        usemtl wall\nf 1 2 3\nusemtl lamp\nf 1 3 4\n";
    const MATERIALS: &str = "newmtl wall\nKd 0.5\nnewmtl lamp\nKd 0\nKe 1 1 1\n";

    fn import(lights: &str) -> Result<Imported, ImportError> {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        place("s.mtl", MATERIALS);
        load(&place("s.obj", SCENE), Some(&place("l.toml", lights)))
    }

    #[test]
    fn lights_are_added_and_replaced() {
        let Imported { scene, repairs, .. } = import(
            "[[light]]\nname = 'lamp'\nemission = [0, 2, 0.5]\nimportance = 0.5\n\
             [[light]]\nname = 'desk'\nkind = 'spot'\nposition = [0.0, 2.4, 0.0]\n\
             direction = [0, -2, 0]\ninner = 0.3\nouter = 0.6\nfalloff = 'linear'\nemission = [10, 9, 7]\n\
             [[light]]\nname = 'panel'\nkind = 'area'\nemission = 4\nreflectance = 0.25\n\
             polygon = [[0,0,3],[0,1,3],[1,1,3]]\n\
             [[light]]\nname = 'panel'\nkind = 'point'\nposition = [1,1,1]\nemission = [1, 8, 0]\n\
             [[light]]\nname = 'day'\nkind = 'sun'\ndirection = [0, 0, -1]\nangle = 0.0093\nemission = 0\n\
             [[light]]\nname = 'sky'\nkind = 'sky'\nemission = [1,1,1]\n",
        )
        .unwrap();
        let lights: Vec<_> = scene
            .lights
            .iter()
            .map(|l| (l.name.as_str(), l.emission.to_array(), l.importance))
            .collect();
        assert_eq!(
            lights,
            [
                ("lamp", [0.0, 2.0, 0.5], 0.5),
                ("desk", [10.0, 9.0, 7.0], 1.0),
                ("panel", [4.0, 8.0, 4.0], 1.0),
                ("day", [0.0; 3], 1.0),
                ("sky", [1.0; 3], 1.0),
            ]
        );
        assert_eq!(scene.surfaces.len(), 3);
        let panel = &scene.surfaces[2];
        assert_eq!(panel.emission().unwrap().share, Rgb::new(1.0, 0.5, 1.0));
        assert_eq!(panel.reflectance().get(), Rgb::splat(0.25));
        assert!(panel.is_two_sided());
        assert_eq!(scene.textures.len(), 3);
        let tags: Vec<_> = scene
            .luminaires
            .iter()
            .map(|l| (l.light(), *l.source()))
            .collect();
        assert_eq!(
            tags[0],
            (
                1,
                Source::Spot {
                    position: Vec3::new(0.0, 2.4, 0.0),
                    direction: -Vec3::Y,
                    inner: 0.3,
                    outer: 0.6,
                    falloff: scene::Falloff::Linear,
                }
            )
        );
        assert_eq!(scene.luminaires[1].share(), Rgb::new(0.25, 1.0, 0.0));
        assert_eq!(scene.luminaires[2].share(), Rgb::WHITE);
        assert_eq!(tags[3], (4, Source::Sky));
        assert_eq!(repairs.ignored_light_geometry, 0);
    }

    #[test]
    fn a_replaced_light_stays_where_it_is() {
        let lights =
            "[[light]]\nname = 'lamp'\nkind = 'point'\nposition = [0,0,1]\nemission = [5,5,5]\n";
        let Imported { scene, repairs, .. } = import(lights).unwrap();
        assert_eq!((scene.lights.len(), scene.luminaires.len()), (1, 0));
        assert_eq!(scene.lights[0].emission, Rgb::splat(5.0));
        assert_eq!(repairs.ignored_light_geometry, 1);
        let lights = "[[light]]\nname = 'lamp'\nkind = 'area'\nemission = [5,5,5]\n";
        assert_eq!(import(lights).unwrap().repairs.ignored_light_geometry, 0);
    }

    #[test]
    fn errors_name_file_entry_and_remedy() {
        let first = "[[light]]\nname = 'sky'\nkind = 'sky'\nemission = 1\n[[light]]\n";
        let polygon = "polygon = [[0,0,0],[1,0,0],[0,1,0]]\n";
        let cases = [
            (
                "name = 'x'\nkind = 'point'\nemission = 1",
                "light 2 (\"x\"): a point light needs `position = [x, y, z]`",
            ),
            (
                "name = 'x'\nkind = 'sun'\nemission = 1",
                "a sun needs `direction",
            ),
            (
                "name = 'x'\nkind = 'area'\nemission = 1",
                "an area light needs `polygon",
            ),
            (
                "name = 'x'\nkind = 'sky'",
                "needs an `emission = [r, g, b]`",
            ),
            (
                "name = 'x'\nkind = 'sky'\nemission = [1, -1, 1]",
                "`emission` (1, -1, 1) must be",
            ),
            (
                "name = 'x'\nkind = 'sky'\nemission = nan",
                "must be numbers",
            ),
            (
                "name = 'x'\nkind = 'sky'\nemission = [1, 2]",
                "expected a number or three numbers",
            ),
            (
                "name = 'x'\nkind = 'sky'\nemission = 1\nimportance = 0",
                "`importance` 0 must be",
            ),
            (
                "name = 'x'\nkind = 'sky'\nemission = 1\nimportance = inf",
                "`importance` inf",
            ),
            (
                "name = 'x'\nkind = 'sky'\nemission = 1\ncolour = 1",
                "light 2 (\"x\"): unknown field `colour`",
            ),
            (
                "name = 'x'\nkind = 'laser'\nemission = 1",
                "unknown variant `laser`",
            ),
            (
                "name = 'x'\nemission = 1",
                "the scene has no light of that name (it has: \"lamp\")",
            ),
            (
                "kind = 'sky'\nemission = 1",
                "light 2 (\"\"): missing field `name`",
            ),
            ("name = ''\nkind = 'sky'\nemission = 1", "the name is empty"),
            (
                "name = 'x'\nkind = 'point'\nposition = [0,0,0]\nangle = 1\nemission = 1",
                "a point light has no `angle`; remove it",
            ),
            (
                "name = 'x'\nkind = 'spot'\nposition = [0,0,0]\ndirection = [0,0,0]\nemission = 1",
                "zero vector",
            ),
            (
                "name = 'x'\nkind = 'spot'\nposition = [0,0,0]\ndirection = [0,0,1]\ninner = 1\nouter = 0.5\nemission = 1",
                "0 <= inner <= outer <= pi",
            ),
            (
                "name = 'x'\nkind = 'area'\npolygon = [[0,0,0],[1,0,0],[0,2e10,0]]\nemission = 1",
                "`polygon`: vertex (0e0, 2e10, 0e0) is too far away; scale",
            ),
            (
                "name = 'x'\nkind = 'area'\npolygon = [[0,0,0],[1,0,0]]\nemission = 1",
                "`polygon`: a polygon has three or four vertices",
            ),
            (
                "name = 'x'\nkind = 'area'\nreflectance = -1\nemission = 1\npolygon = [[0,0,0],[1,0,0],[0,1,0]]",
                "`reflectance` (-1, -1, -1)",
            ),
        ];
        for (entry, expected) in cases {
            let message = import(&format!("{first}{entry}\n"))
                .unwrap_err()
                .to_string();
            assert!(
                message.contains("l.toml, light 2 (") && message.contains(expected),
                "{message}"
            );
            assert!(!message.contains('\n'), "{message}");
        }
        let twice =
            "[[light]]\nname = 'lamp'\nemission = 1\n[[light]]\nname = 'lamp'\nemission = 2\n";
        let message = import(twice).unwrap_err().to_string();
        assert!(
            message.contains("light 2 (\"lamp\"): light 1 replaces the same light"),
            "{message}"
        );
        for (text, expected) in [
            ("[[light]]\nname = \n", "l.toml, line 2: "),
            ("[[lights]]\nname = 'x'\n", "unknown field `lights`"),
            (
                "[[light]]\nname = 'x'\nname = 'y'\n",
                "line 3: duplicate key",
            ),
        ] {
            let message = import(text).unwrap_err().to_string();
            assert!(
                message.contains(expected) && !message.contains('\n'),
                "{message}"
            );
        }
        let dark = format!("[[light]]\nname = 'x'\nkind = 'area'\nemission = 0\n{polygon}");
        assert!(import(&dark).is_ok());
    }

    #[test]
    fn a_million_lights_are_refused_at_once() {
        let message = import(&"[[light]]\n".repeat(1_000_000))
            .unwrap_err()
            .to_string();
        assert!(message.ends_with("1000000 lights; at most 262144 entries are handled, use fewer"));
    }

    #[test]
    fn light_files_are_read_as_utf_8_and_may_be_empty() {
        assert_eq!(import("").unwrap().scene.lights.len(), 1);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bad.toml");
        std::fs::write(&path, b"# \xff").unwrap();
        let message = apply(&path, &mut Draft::default(), &mut Repairs::default()).unwrap_err();
        assert!(message.to_string().contains("bad.toml, line 1: not UTF-8"));
    }
}
