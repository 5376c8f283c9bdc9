//! Prepares the text of OBJ and MTL files for the parser, which knows no line numbers.
//!
//! Only the statements that matter here are left (`v vt f usemtl mtllib`; `newmtl Kd Ke map_Kd`),
//! one per line, in plain form; vertex colours, normals, groups, points and polylines are taken
//! out. Numbers and indices are checked on the way, so that an error can name its line.
//! Texture coordinate 1 of the plain text is no place but NaN: the parser gives corners without a
//! texture coordinate that of their predecessor, and they get this one instead.
//! Format: Wavefront, Advanced Visualizer, appendix B1 (OBJ) and the MTL specification.

use super::polygons::MOST_CORNERS;

/// What is wrong with a line, and its number from 1.
pub(super) type LineFault = (usize, String);

/// An OBJ file in plain form.
#[derive(Debug, Default)]
pub(super) struct PlainObj {
    /// The text for the parser.
    pub text: String,
    /// Names of material files, in order.
    pub libraries: Vec<String>,
    /// Points, lines, curves and surfaces that were taken out.
    pub skipped: usize,
    /// Faces of fewer than three corners that were taken out.
    pub too_small: usize,
}

/// Statements with their line numbers; a backslash at the end of a line continues it.
fn statements(text: &str) -> impl Iterator<Item = (usize, String)> + '_ {
    let mut lines = text.lines().zip(1..);
    std::iter::from_fn(move || {
        let (first, number) = lines.next()?;
        let mut statement = first.to_owned();
        while statement.ends_with('\\') {
            statement.pop();
            statement.push(' ');
            statement.push_str(lines.next().map_or("", |(line, _)| line));
        }
        Some((number, statement))
    })
}

/// The keyword of a statement and the rest of it; a comment has `#` for its keyword.
fn split(statement: &str) -> (&str, &str) {
    let statement = statement.trim();
    let end = statement
        .find(char::is_whitespace)
        .unwrap_or(statement.len());
    let (keyword, rest) = statement.split_at(end);
    (keyword, rest.trim())
}

/// The words of a statement without names, in which a `#` can only begin a comment.
fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split_whitespace()
        .take_while(|word| !word.starts_with('#'))
}

/// Brings an OBJ file into plain form.
///
/// # Errors
/// The first line whose numbers are no numbers or whose indices point nowhere.
pub(super) fn plain_obj(text: &str) -> Result<PlainObj, LineFault> {
    let mut plain = PlainObj {
        text: "vt nan nan\n".to_owned(),
        ..PlainObj::default()
    };
    let mut defined = Defined::default();
    for (number, statement) in statements(text) {
        let at_line = |fault| (number, fault);
        let (keyword, rest) = split(&statement);
        let kept = match keyword {
            "v" => {
                defined.vertices += 1;
                position(rest).map_err(at_line)?
            }
            "vt" => {
                defined.places += 1;
                texture_place(rest).map_err(at_line)?
            }
            "f" => match face(rest, defined).map_err(at_line)? {
                Some(corners) => corners,
                None => {
                    plain.too_small += 1;
                    continue;
                }
            },
            "usemtl" if !rest.is_empty() => rest.to_owned(),
            "mtllib" if !rest.is_empty() => {
                plain.libraries.push(rest.to_owned());
                rest.to_owned()
            }
            "usemtl" | "mtllib" => {
                return Err(at_line(format!("`{keyword}` without a name; add one")));
            }
            "p" | "l" | "curv" | "curv2" | "surf" => {
                plain.skipped += 1;
                continue;
            }
            _ => continue,
        };
        plain.text.push_str(keyword);
        plain.text.push(' ');
        plain.text.push_str(&kept);
        plain.text.push('\n');
    }
    Ok(plain)
}

/// How many vertices and texture coordinates stand above a line.
#[derive(Clone, Copy, Default)]
struct Defined {
    vertices: usize,
    places: usize,
}

/// `x y z`, with a weight only where it is no vertex colour.
fn position(rest: &str) -> Result<String, String> {
    let numbers = numbers(rest, "v")?;
    match *numbers {
        [_, _, _, 0.0] => Err("a vertex with weight 0 lies nowhere; correct it".to_owned()),
        [x, y, z, w] => plain_numbers([x / w, y / w, z / w]),
        [x, y, z, ..] => plain_numbers([x, y, z]),
        _ => Err("a vertex needs three numbers; the file may be cut off here".to_owned()),
    }
}

fn plain_numbers([x, y, z]: [f32; 3]) -> Result<String, String> {
    if [x, y, z].iter().all(|number| number.is_finite()) {
        return Ok(format!("{x} {y} {z}"));
    }
    Err(format!(
        "vertex ({x}, {y}, {z}) is not finite; correct or remove it"
    ))
}

/// `u v`; a texture of one dimension has only `u`.
fn texture_place(rest: &str) -> Result<String, String> {
    match *numbers(rest, "vt")? {
        [u, v, ..] => Ok(format!("{u} {v}")),
        [u] => Ok(format!("{u} 0")),
        [] => Err("`vt` without numbers; the file may be cut off here".to_owned()),
    }
}

fn numbers(rest: &str, keyword: &str) -> Result<Vec<f32>, String> {
    let number = |word: &str| {
        word.parse()
            .map_err(|_| format!("{word:?} after `{keyword}` is not a number; correct it"))
    };
    words(rest).map(number).collect()
}

/// The corners as `v/vt`, in the numbering of the plain text; `None` for fewer than three.
fn face(rest: &str, defined: Defined) -> Result<Option<String>, String> {
    let corners: Vec<String> = words(rest)
        .map(|word| corner(word, defined))
        .collect::<Result<_, _>>()?;
    if corners.len() > MOST_CORNERS {
        return Err(format!(
            "a face of {} corners; at most {MOST_CORNERS} are handled, triangulate it",
            corners.len()
        ));
    }
    Ok((corners.len() >= 3).then(|| corners.join(" ")))
}

/// Vertex and texture coordinate of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`.
fn corner(word: &str, defined: Defined) -> Result<String, String> {
    let mut parts = word.split('/');
    let vertex = index(parts.next().unwrap_or_default(), defined.vertices, "vertex")?;
    let place = match parts.next().unwrap_or_default() {
        "" => 0,
        part => index(part, defined.places, "texture coordinate")?,
    };
    Ok(format!("{vertex}/{}", place + 1))
}

/// An index counted from 1; negative ones count back from the last one defined.
fn index(word: &str, defined: usize, what: &str) -> Result<usize, String> {
    let fault =
        || format!("{word:?} is no {what} of the {defined} above this line; correct the face");
    let index: i64 = word.parse().map_err(|_| fault())?;
    let distance = usize::try_from(index.unsigned_abs()).map_err(|_| fault())?;
    if distance == 0 || distance > defined {
        return Err(fault());
    }
    Ok(if index > 0 {
        distance
    } else {
        defined - distance + 1
    })
}

/// Brings an MTL file into plain form; also how many statements name images that are not used.
///
/// # Errors
/// The first line that names nothing or has the wrong numbers.
pub(super) fn plain_mtl(text: &str) -> Result<(String, usize), LineFault> {
    let mut plain = String::new();
    let mut ignored = 0;
    for (number, statement) in statements(text) {
        let (keyword, rest) = split(&statement);
        let kept = match keyword {
            "Kd" | "Ke" => colour(rest, keyword).map_err(|fault| (number, fault))?,
            "newmtl" | "map_Kd" if rest.is_empty() => {
                return Err((number, format!("`{keyword}` without a name; add one")));
            }
            "newmtl" | "map_Kd" => rest.to_owned(),
            _ => {
                ignored += usize::from(is_image(keyword));
                continue;
            }
        };
        plain.push_str(keyword);
        plain.push(' ');
        plain.push_str(&kept);
        plain.push('\n');
    }
    Ok((plain, ignored))
}

/// True for statements that name an image.
fn is_image(keyword: &str) -> bool {
    keyword.starts_with("map_") || matches!(keyword, "bump" | "disp" | "decal" | "norm" | "refl")
}

/// `r g b`; a single number stands for all three.
fn colour(rest: &str, keyword: &str) -> Result<String, String> {
    match *numbers(rest, keyword)? {
        [grey] => Ok(format!("{grey} {grey} {grey}")),
        [r, g, b] => Ok(format!("{r} {g} {b}")),
        _ => Err(format!("`{keyword}` needs one number or three; correct it")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_obj_becomes_plain() {
        let text = "\u{feff}# head\nmtllib\ta b.mtl\nv 1 2 3 0.5 0.5 0.5 # red\nv 2 4 6 2\n  v\t-1 0 1e1\n\
            vt 0.5\nvt 0.25 1 0\nvn 0 0 1\no box\nusemtl  my  wall #2 \nf 1/1/1 2/2/1 \\\n-1/-1/1\n\
            f 1/1 2 3 # x\nf -3//1 -2//1 -1//1\nl 1 2 3\np 1\nf 1 2\ns off\n";
        let plain = plain_obj(text.trim_start_matches('\u{feff}')).unwrap();
        assert_eq!(
            plain.text,
            "vt nan nan\nmtllib a b.mtl\nv 1 2 3\nv 1 2 3\nv -1 0 10\nvt 0.5 0\nvt 0.25 1\n\
             usemtl my  wall #2\nf 1/2 2/3 3/3\nf 1/2 2/1 3/1\nf 1/1 2/1 3/1\n"
        );
        assert_eq!(plain.libraries, ["a b.mtl"]);
        assert_eq!((plain.skipped, plain.too_small), (2, 1));
    }

    #[test]
    fn faults_name_their_line() {
        let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
        let cases = [
            ("f 1 2 4", "\"4\" is no vertex of the 3 above"),
            ("f 1 2 0", "\"0\" is no vertex"),
            ("f 1 2 -4", "\"-4\" is no vertex"),
            ("f 1 2 -9223372036854775808", "is no vertex"),
            ("f 1 2 99999999999999999999", "is no vertex"),
            (
                "f 1/2 2/1 3/1",
                "\"2\" is no texture coordinate of the 1 above",
            ),
            ("f a b c", "\"a\" is no vertex"),
            ("v 1 2", "needs three numbers"),
            ("v 1 nan 2", "not finite"),
            ("v 1 1e999 2", "not finite"),
            ("v 1 1 2 0", "weight 0"),
            ("v 1 x 2", "\"x\" after `v` is not a number"),
            ("vt", "without numbers"),
            ("usemtl", "without a name"),
        ];
        for (line, expected) in cases {
            let (number, fault) = plain_obj(&format!("{head}{line}\nf 1 2 3")).unwrap_err();
            assert_eq!(number, 5, "{line}");
            assert!(fault.contains(expected), "{line}: {fault}");
        }
        let big = format!("{head}f {}", "1 ".repeat(MOST_CORNERS + 1));
        assert!(plain_obj(&big).unwrap_err().1.contains("4097 corners"));
    }

    #[test]
    fn an_mtl_becomes_plain() {
        let plain = plain_mtl("newmtl a b\n\tKd 0.5\nKe 1 2 3\nd x\nmap_Kd -s 1 1 1 t.png\nKs 1\n");
        assert_eq!(
            plain.unwrap(),
            (
                "newmtl a b\nKd 0.5 0.5 0.5\nKe 1 2 3\nmap_Kd -s 1 1 1 t.png\n".to_owned(),
                0
            )
        );
        let images = "newmtl a\nmap_Ke glow.png\nmap_Ka x.png\nbump b.png\nnorm n.png\nillum 2\n";
        assert_eq!(plain_mtl(images).unwrap(), ("newmtl a\n".to_owned(), 4));
        assert_eq!(plain_mtl("\nKd 1 2").unwrap_err().0, 2);
        assert_eq!(plain_mtl("Kd spectral f.rfl").unwrap_err().0, 1);
        assert_eq!(plain_mtl("newmtl").unwrap_err().0, 1);
    }
}
