//! What an importer repaired or left out, counted, so that nobody is surprised by the result.

use serde::Serialize;

/// Counts of everything that was repaired, replaced by a default or ignored; zeros for a clean file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Repairs {
    /// Faces dropped because another one lies in the same place.
    pub duplicate_faces: usize,
    /// Faces dropped because they have no area or fewer than three corners.
    pub degenerate_faces: usize,
    /// Faces that named a vertex twice in a row; one of the two was dropped.
    pub repeated_vertices: usize,
    /// Faces of more than four vertices, triangulated.
    pub large_polygons: usize,
    /// Quads whose vertices do not lie in one plane, triangulated.
    pub warped_quads: usize,
    /// Concave quads, triangulated.
    pub concave_quads: usize,
    /// Triangulated faces whose triangles have another area than the outline, because it crosses
    /// itself or is far from flat.
    pub crossed_outlines: usize,
    /// Quads put together from two triangles.
    pub recovered_quads: usize,
    /// Surfaces whose reflectance was lowered to 0.98 in some channel.
    pub clamped_reflectances: usize,
    /// Faces without a material, or whose material the file does not have: reflectance 0.5.
    pub default_reflectances: usize,
    /// Material files that do not exist.
    pub missing_material_files: usize,
    /// Materials whose reflectance comes from an image.
    pub textures_used: usize,
    /// Images that are missing or cannot be decoded; the material's plain colour is used.
    pub missing_textures: usize,
    /// Faces of a textured material without texture coordinates: the image's mean is used.
    pub missing_texture_coordinates: usize,
    /// Materials whose texture options (scale, offset, clamping) were ignored.
    pub ignored_texture_options: usize,
    /// Images of materials that were ignored, because they are not of the reflectance: OBJ's
    /// `map_Ke`, `map_d`, `bump` and their like.
    pub ignored_textures: usize,
    /// Materials whose emissive image was replaced by its mean.
    pub averaged_emissive_textures: usize,
    /// Materials whose metallic factor was ignored.
    pub ignored_metallic: usize,
    /// Primitives whose vertex colours were ignored.
    pub ignored_vertex_colours: usize,
    /// Points and lines skipped (primitives in glTF, statements in OBJ).
    pub skipped_points_and_lines: usize,
    /// Light entries whose own place was ignored, because the scene already has a light of that
    /// name and only its emission is replaced.
    pub ignored_light_geometry: usize,
}

impl Repairs {
    /// One short line for every count above zero.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let counts = [
            (self.duplicate_faces, "duplicate faces dropped"),
            (self.degenerate_faces, "faces without area dropped"),
            (
                self.repeated_vertices,
                "faces with repeated vertices mended",
            ),
            (
                self.large_polygons,
                "polygons of more than four vertices triangulated",
            ),
            (self.warped_quads, "warped quads triangulated"),
            (self.concave_quads, "concave quads triangulated"),
            (
                self.crossed_outlines,
                "outlines crossed or not flat, filled as far as possible",
            ),
            (
                self.recovered_quads,
                "quads put together from two triangles",
            ),
            (
                self.clamped_reflectances,
                "surfaces with reflectance lowered to 0.98",
            ),
            (
                self.default_reflectances,
                "faces without a material given reflectance 0.5",
            ),
            (self.missing_material_files, "material files not found"),
            (
                self.textures_used,
                "textured materials, averaged per element",
            ),
            (
                self.missing_textures,
                "textures not readable, plain colour used",
            ),
            (
                self.missing_texture_coordinates,
                "textured faces without coordinates averaged",
            ),
            (
                self.ignored_texture_options,
                "materials with texture options ignored",
            ),
            (
                self.ignored_textures,
                "textures of emission, relief and the like ignored",
            ),
            (
                self.averaged_emissive_textures,
                "emissive textures averaged",
            ),
            (
                self.ignored_metallic,
                "materials with metallic factor ignored",
            ),
            (
                self.ignored_vertex_colours,
                "primitives with vertex colours ignored",
            ),
            (self.skipped_points_and_lines, "points and lines skipped"),
            (
                self.ignored_light_geometry,
                "light entries whose place was ignored (emission replaced)",
            ),
        ];
        let counted = counts.iter().filter(|(count, _)| *count > 0);
        counted
            .map(|(count, what)| format!("{what}: {count}"))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clean_file_says_nothing_and_a_dirty_one_counts() {
        assert!(Repairs::default().lines().is_empty());
        let dirty = Repairs {
            duplicate_faces: 3,
            warped_quads: 1,
            ..Repairs::default()
        };
        let expected = ["duplicate faces dropped: 3", "warped quads triangulated: 1"];
        assert_eq!(dirty.lines(), expected);
    }

    #[test]
    fn every_count_has_a_line() {
        let counts = serde_json::to_value(Repairs::default()).unwrap();
        let ones: serde_json::Map<_, _> = counts
            .as_object()
            .unwrap()
            .keys()
            .map(|key| (key.clone(), 1.into()))
            .collect();
        assert_eq!(all_ones().lines().len(), ones.len());
        assert_eq!(
            serde_json::to_value(all_ones()).unwrap(),
            serde_json::Value::Object(ones)
        );
    }

    fn all_ones() -> Repairs {
        Repairs {
            duplicate_faces: 1,
            degenerate_faces: 1,
            repeated_vertices: 1,
            large_polygons: 1,
            warped_quads: 1,
            concave_quads: 1,
            crossed_outlines: 1,
            recovered_quads: 1,
            clamped_reflectances: 1,
            default_reflectances: 1,
            missing_material_files: 1,
            textures_used: 1,
            missing_textures: 1,
            missing_texture_coordinates: 1,
            ignored_texture_options: 1,
            ignored_textures: 1,
            averaged_emissive_textures: 1,
            ignored_metallic: 1,
            ignored_vertex_colours: 1,
            skipped_points_and_lines: 1,
            ignored_light_geometry: 1,
        }
    }
}
