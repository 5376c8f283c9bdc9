//! Imports go one way: a file names only modules that are declared above its own.
//!
//! The source text is read, not the compiler's mind: comments, literals and test items are left out,
//! then `crate::name`, `super::name` and `relume::name` tell what a file knows of.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The solver's modules in import order.
const SOLVER: [&str; 14] = [
    "math",
    "color",
    "geometry",
    "scene",
    "mesh",
    "visibility",
    "form_factor",
    "luminaire",
    "refine",
    "code",
    "atlas",
    "relight",
    "tone",
    "draw",
];

/// What stands at the top level, besides dot files, licences and what cargo and the program make.
const TOP_LEVEL: [&str; 6] = [
    "Cargo.toml",
    "README.md",
    "solver",
    "host",
    "tests",
    "benches",
];

/// One source file.
struct Source {
    path: PathBuf,
    /// The top-level module that it belongs to.
    module: String,
    /// How many modules deep it is: 1 for a top-level module itself.
    depth: usize,
    /// Its tokens without comments, literals and test items.
    tokens: Vec<String>,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Identifiers, `::` and single signs of a source text; comments and literals are left out.
fn tokens(text: &str) -> Vec<String> {
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            block_comment(rest)
        } else if let Some(hashes) = raw_string(rest) {
            let end = format!("\"{}", "#".repeat(hashes));
            let start = 2 + hashes;
            start + rest[start..].find(&end).unwrap() + end.len()
        } else if first == '"' {
            quoted(rest, '"')
        } else if first == '\'' && is_character(rest) {
            quoted(rest, '\'')
        } else {
            let is_word = |c: char| c.is_alphanumeric() || c == '_';
            let word = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            let length = match word {
                0 if rest.starts_with("::") => 2,
                0 => first.len_utf8(),
                word => word,
            };
            if !first.is_whitespace() {
                tokens.push(rest[..length].to_owned());
            }
            length
        };
        rest = &rest[length..];
    }
    tokens
}

/// Length of a comment that opens with `/*`; such comments nest.
fn block_comment(text: &str) -> usize {
    let (mut open, mut at) = (0, 0);
    loop {
        match &text.as_bytes()[at..] {
            [b'/', b'*', ..] => (open, at) = (open + 1, at + 2),
            [b'*', b'/', ..] => (open, at) = (open - 1, at + 2),
            [] => return at,
            _ => at += 1,
        }
        if open == 0 {
            return at;
        }
    }
}

/// Number of signs `#` of a raw string that starts here.
fn raw_string(text: &str) -> Option<usize> {
    let hashes = text.strip_prefix('r')?;
    let content = hashes.trim_start_matches('#');
    content
        .starts_with('"')
        .then_some(hashes.len() - content.len())
}

/// Length of a literal in quotes.
fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        if c == quote && !escaped {
            return at + 1;
        }
        escaped = c == '\\' && !escaped;
    }
    text.len()
}

/// A character literal rather than a lifetime.
fn is_character(text: &str) -> bool {
    let mut following = text.chars().skip(1);
    following.next() == Some('\\') || following.next() == Some('\'')
}

/// Takes items under `#[cfg(test)]` out of the tokens; returns the names of test modules that have
/// files of their own.
fn without_tests(tokens: Vec<String>) -> (Vec<String>, Vec<String>) {
    let (mut kept, mut files) = (Vec::new(), Vec::new());
    let mut at = 0;
    while at < tokens.len() {
        if !tokens[at..].starts_with(&["#", "[", "cfg", "(", "test", ")", "]"].map(String::from)) {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        let end = item_end(&tokens, at + 7);
        if let [.., keyword, name, semicolon] = &tokens[at..end]
            && keyword == "mod"
            && semicolon == ";"
        {
            files.push(name.clone());
        }
        at = end;
    }
    (kept, files)
}

/// The token after an item: behind its semicolon or its closing brace.
fn item_end(tokens: &[String], start: usize) -> usize {
    let mut open = 0;
    for (at, token) in tokens.iter().enumerate().skip(start) {
        match token.as_str() {
            "(" | "[" | "{" => open += 1,
            ")" | "]" => open -= 1,
            "}" => {
                open -= 1;
                if open == 0 {
                    return at + 1;
                }
            }
            ";" if open == 0 => return at + 1,
            _ => {}
        }
    }
    tokens.len()
}

/// All files of a crate's `src` but `lib.rs`, `main.rs` and test files.
fn sources(folder: &str) -> Vec<Source> {
    let mut sources = Vec::new();
    let mut test_files = BTreeSet::new();
    collect(&root().join(folder), &[], &mut sources, &mut test_files);
    sources.retain(|s: &Source| !test_files.contains(&s.path));
    assert!(!sources.is_empty(), "{folder} is empty");
    sources
}

fn collect(
    folder: &Path,
    modules: &[String],
    sources: &mut Vec<Source>,
    test_files: &mut BTreeSet<PathBuf>,
) {
    let mut entries: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    entries.sort();
    for path in entries {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let mut inner = modules.to_vec();
        if name != "mod" {
            inner.push(name.clone());
        }
        if path.is_dir() {
            collect(&path, &inner, sources, test_files);
            continue;
        }
        let is_root = modules.is_empty() && (name == "lib" || name == "main");
        if path.extension().is_none_or(|e| e != "rs") || is_root {
            continue;
        }
        let (tokens, tests) = without_tests(tokens(&fs::read_to_string(&path).unwrap()));
        let home = path.with_extension("");
        let home = if name == "mod" { folder } else { &home };
        test_files.extend(
            tests
                .iter()
                .map(|test| home.join(test).with_extension("rs")),
        );
        sources.push(Source {
            path,
            module: inner[0].clone(),
            depth: inner.len(),
            tokens,
        });
    }
}

/// The modules that a `lib.rs` declares, in order.
fn declared(library: &str) -> Vec<String> {
    let (tokens, _) = without_tests(tokens(&fs::read_to_string(root().join(library)).unwrap()));
    let declarations = tokens.windows(3).filter(|w| w[0] == "mod" && w[2] == ";");
    declarations.map(|w| w[1].clone()).collect()
}

impl Source {
    /// First names of the paths that start at `crate`, spelt `crate::` or as enough `super::`.
    fn own_crate(&self) -> BTreeSet<&str> {
        let mut names = self.outside("crate");
        let supers = vec!["super"; self.depth];
        let starts = 0..self.tokens.len();
        for at in starts.filter(|at| *at == 0 || self.tokens[at - 1] != "::") {
            let path = self.tokens[at..].chunks(2);
            let chain = path.take_while(|c| c.len() == 2 && c[0] == "super" && c[1] == "::");
            if chain.count() == supers.len() {
                names.extend(heads(&self.tokens[at + 2 * supers.len()..]));
            }
        }
        names
    }

    /// First names of the paths into a crate.
    fn outside(&self, name: &str) -> BTreeSet<&str> {
        let starts = 0..self.tokens.len().saturating_sub(2);
        starts
            .filter(|at| self.tokens[*at] == name && self.tokens[at + 1] == "::")
            .flat_map(|at| heads(&self.tokens[at + 2..]))
            .collect()
    }

    fn says(&self, word: &str) -> bool {
        self.tokens.iter().any(|t| t == word)
    }
}

/// First names of a path or of a group `{a::b, c}` of paths.
fn heads(tokens: &[String]) -> Vec<&str> {
    if tokens[0] != "{" {
        return vec![&tokens[0]];
    }
    let (mut names, mut open, mut is_first) = (Vec::new(), 0, true);
    for token in tokens {
        match token.as_str() {
            "{" => open += 1,
            "}" if open == 1 => break,
            "}" => open -= 1,
            "," if open == 1 => is_first = true,
            name if open == 1 && is_first => {
                names.push(name);
                is_first = false;
            }
            _ => {}
        }
    }
    names
}

/// Every file of `sources` names only modules up to its own.
fn assert_one_way(sources: &[Source], order: &[String]) {
    let place = |module: &str| order.iter().position(|m| m == module);
    for source in sources {
        let path = source.path.display();
        let own = place(&source.module);
        assert!(
            own.is_some(),
            "{path}: lib.rs does not declare `{}`",
            source.module
        );
        for name in source.own_crate() {
            let named = place(name);
            assert!(
                named.is_some(),
                "{path}: `crate::{name}` is no module of lib.rs"
            );
            assert!(
                named <= own,
                "{path} names `{name}`, which is declared below it"
            );
        }
    }
}

#[test]
fn the_solver_is_declared_in_import_order() {
    assert_eq!(declared("solver/src/lib.rs"), SOLVER);
}

#[test]
fn solver_files_name_only_files_above_them() {
    assert_one_way(&sources("solver/src"), &SOLVER.map(String::from));
}

#[test]
fn host_files_name_only_modules_above_them() {
    assert_one_way(&sources("host/src"), &declared("host/src/lib.rs"));
}

#[test]
fn codes_and_atlas_know_nothing_of_the_solve_and_tone_nothing_of_the_mesh() {
    for source in sources("solver/src") {
        let unknown: &[&str] = match source.module.as_str() {
            "code" | "atlas" => &["refine", "form_factor"],
            "tone" => &["mesh"],
            _ => &[],
        };
        for name in unknown {
            let path = source.path.display();
            assert!(!source.own_crate().contains(name), "{path} names `{name}`");
        }
    }
}

#[test]
fn one_file_names_libm_and_one_embedded_graphics() {
    for source in sources("solver/src") {
        for (word, module) in [("libm", "math"), ("embedded_graphics", "draw")] {
            let path = source.path.display();
            assert!(
                !source.says(word) || source.module == module,
                "{path} names `{word}`"
            );
        }
    }
}

#[test]
fn references_share_no_transport_code_with_what_they_check() {
    let sources = sources("host/src");
    let references: Vec<&Source> = sources.iter().filter(|s| s.module == "reference").collect();
    assert!(
        references.len() >= 4,
        "closed forms, dense solution, path tracer"
    );
    for source in references {
        let path = source.path.display();
        let solver = source.outside("relume");
        assert!(
            solver.is_subset(&BTreeSet::from(["color", "scene"])),
            "{path} takes more than plain data from the solver: {solver:?}"
        );
        let host = source.own_crate();
        assert!(
            host.is_subset(&BTreeSet::from(["reference", "scene"])),
            "{path} takes more than plain data from the host: {host:?}"
        );
        let calls = source.tokens.windows(6);
        for call in calls.filter(|w| w[..4] == [".", "polygon", "(", ")"]) {
            assert_eq!(
                call[5], "vertices",
                "{path}: of a polygon only the vertices are read"
            );
        }
    }
}

#[test]
fn exact_form_factors_share_no_code_with_the_solver_or_the_references() {
    let sources = sources("host/src");
    let exact = sources.iter().filter(|s| s.module == "polygon_pair");
    let exact: Vec<&Source> = exact.collect();
    assert!(exact.len() >= 2, "one file per method");
    for source in exact {
        let path = source.path.display();
        assert!(!source.says("relume"), "{path} names the solver");
        let host = source.own_crate();
        assert!(
            host.is_subset(&BTreeSet::from(["polygon_pair"])),
            "{path} takes from the host: {host:?}"
        );
    }
}

#[test]
fn the_top_level_holds_what_a_visitor_has_to_understand() {
    let entries = fs::read_dir(root()).unwrap();
    let all = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    let names: BTreeSet<String> = all
        .filter(|n| !n.starts_with('.') && !n.starts_with("LICENSE-"))
        .filter(|n| !["Cargo.lock", "target", "out"].contains(&n.as_str()))
        .collect();
    assert_eq!(names, TOP_LEVEL.map(String::from).into());
}

#[test]
fn no_file_is_named_after_nothing() {
    for source in ["solver/src", "host/src"].into_iter().flat_map(sources) {
        let name = source
            .path
            .file_stem()
            .unwrap()
            .to_string_lossy()
            .into_owned();
        let says_nothing = ["utils", "util", "types", "prelude", "helpers", "common"];
        assert!(
            !says_nothing.contains(&name.as_str()),
            "{}",
            source.path.display()
        );
    }
}

#[test]
fn the_reader_skips_comments_literals_and_tests() {
    let text = r##"
        //! [`crate::a`]
        use crate::b::{c, d}; /* crate::e /* nested */ crate::f */
        use super::{g::h, i::{j, k}, l}; use super::super::w;
        fn m<'a>(_: &'a str) -> char { let _ = "crate::n \" // "; let _ = r#"crate::o"#; '\'' }
        #[cfg(test)]
        pub(crate) mod p;
        #[cfg(test)]
        mod tests { use crate::q; fn r() { [0; 3]; } }
        pub(in crate::s) fn t() { crate::u::v(); '"' }
    "##;
    let (tokens, files) = without_tests(tokens(text));
    assert_eq!(files, ["p"]);
    let mut source = Source {
        path: PathBuf::new(),
        module: "b".into(),
        depth: 1,
        tokens,
    };
    let names: Vec<&str> = source.own_crate().into_iter().collect();
    assert_eq!(names, ["b", "g", "i", "l", "s", "u"]);
    assert!(source.says("t") && !source.says("q") && !source.says("o"));
    source.depth = 2;
    let names: Vec<&str> = source.own_crate().into_iter().collect();
    assert_eq!(names, ["b", "s", "u", "w"]);
}
