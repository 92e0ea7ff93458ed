//! `docs/requirements.md` and the tests it names know of each other.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The ids in a text, in the form `INT-` and three digits.
fn ids(text: &str) -> BTreeSet<String> {
    text.match_indices("INT-")
        .filter_map(|(start, _)| text.get(start..start + 7))
        .filter(|id| id[4..].bytes().all(|digit| digit.is_ascii_digit()))
        .map(str::to_owned)
        .collect()
}

/// Every (id, file, function) of the table; a row names at least one, or says "not shown".
fn of_the_table() -> BTreeSet<(String, String, String)> {
    let text = std::fs::read_to_string(workspace().join("docs/requirements.md")).unwrap();
    let mut named = BTreeSet::new();
    for line in text.lines().filter(|line| line.starts_with("| INT-")) {
        let cells: Vec<&str> = line.split(" | ").collect();
        let [id, _, shown_by] = cells[..] else {
            panic!("{line}");
        };
        let id = id.trim_start_matches("| ");
        // Every second part is between backquotes.
        let quoted: Vec<&str> = shown_by.split('`').skip(1).step_by(2).collect();
        let tests: Vec<_> = quoted
            .windows(2)
            .filter(|pair| pair[0].ends_with(".rs"))
            .map(|pair| (id.to_owned(), pair[0].to_owned(), pair[1].to_owned()))
            .collect();
        assert!(!tests.is_empty() || line.contains("not shown"), "{line}");
        named.extend(tests);
    }
    named
}

/// The same of the comments that stand before tests in a file.
fn of_the_file(name: &str, text: &str) -> BTreeSet<(String, String, String)> {
    let mut carried = BTreeSet::new();
    let mut pending = BTreeSet::new();
    for line in text.lines().map(str::trim) {
        if line.starts_with("///") {
            pending.append(&mut ids(line));
        } else if let Some(rest) = line.strip_prefix("fn ") {
            let function = rest.split('(').next().unwrap();
            let of_function = std::mem::take(&mut pending).into_iter();
            carried.extend(of_function.map(|id| (id, name.to_owned(), function.to_owned())));
        } else if !line.starts_with("#[") {
            pending.clear();
        }
    }
    carried
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn every_requirement_names_its_tests_and_they_carry_its_id() {
    let workspace = workspace();
    let mut files = Vec::new();
    for folder in ["core/src", "host-tests/src", "host-tests/tests"] {
        rust_files(&workspace.join(folder), &mut files);
    }
    let mut carried = BTreeSet::new();
    for path in files {
        let name = path.strip_prefix(&workspace).unwrap();
        let name = name.to_str().unwrap().replace('\\', "/");
        carried.append(&mut of_the_file(
            &name,
            &std::fs::read_to_string(&path).unwrap(),
        ));
    }
    let named = of_the_table();
    assert!(named.len() >= 20, "{}", named.len());
    let without_id: Vec<_> = named.difference(&carried).collect();
    assert!(without_id.is_empty(), "not in the code: {without_id:#?}");
    let without_row: Vec<_> = carried.difference(&named).collect();
    assert!(without_row.is_empty(), "not in the table: {without_row:#?}");
}
