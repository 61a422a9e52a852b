//! The layers of the workspace: an arrow between crates points only downwards, and never between stages.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::collections::BTreeMap;
use std::path::Path;

use toml::Table;

/// The layer of each crate, as in ARCHITECTURE.md.
const LAYERS: &[(&str, u32)] = &[
    ("espalier-geom", 0),
    ("espalier-model", 1),
    ("espalier-volume", 2),
    ("espalier-skeleton", 2),
    ("espalier-radius", 2),
    ("espalier-tree", 2),
    ("espalier-views", 2),
    ("espalier-embed", 2),
    ("espalier-render", 2),
    ("espalier-phantom", 2),
    ("espalier-juxtapose", 2),
    ("espalier-verify", 2),
    ("espalier-report", 2),
    ("espalier-pipeline", 3),
    ("espalier-cli", 4),
];

/// What only some crates may depend on, and which.
const RESERVED: &[(&str, &[&str])] = &[
    ("anyhow", &["espalier-cli"]),
    ("clap", &["espalier-cli"]),
    ("indicatif", &["espalier-cli"]),
    ("toml", &["espalier-pipeline"]),
    ("atomic-write-file", &["espalier-pipeline"]),
];

/// The arrows that may not be, each as a sentence.
fn violations(crates: &BTreeMap<String, Vec<String>>) -> Vec<String> {
    let layer = |name: &str| LAYERS.iter().find(|(known, _)| *known == name).map(|(_, layer)| *layer);
    let mut found = Vec::new();
    for (name, dependencies) in crates {
        let Some(own_layer) = layer(name) else {
            found.push(format!("{name} has no layer"));
            continue;
        };
        for dependency in dependencies {
            if layer(dependency).is_some_and(|below| below >= own_layer) {
                found.push(format!("{name} depends on {dependency}, which is not below it"));
            }
            let holders = RESERVED.iter().find(|(reserved, _)| reserved == dependency);
            if holders.is_some_and(|(_, holders)| !holders.contains(&name.as_str())) {
                found.push(format!("{name} depends on {dependency}, which is not for it"));
            }
        }
    }
    found
}

/// The normal dependencies of each crate of the workspace, read from the manifests.
fn crates_of_the_workspace() -> BTreeMap<String, Vec<String>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates");
    let entries = std::fs::read_dir(folder).expect("crates folder");
    entries
        .map(|entry| {
            let manifest = entry.expect("folder entry").path().join("Cargo.toml");
            let text = std::fs::read_to_string(&manifest).expect("manifest");
            let table: Table = toml::from_str(&text).expect("TOML");
            let name = table["package"]["name"].as_str().expect("name").to_owned();
            let dependencies = table["dependencies"].as_table().expect("table").keys().cloned().collect();
            (name, dependencies)
        })
        .collect()
}

#[test]
fn arrows_point_downwards() {
    let crates = crates_of_the_workspace();
    assert_eq!(crates.len(), LAYERS.len(), "a crate is missing from the table of layers");
    assert_eq!(violations(&crates), Vec::<String>::new());
}

#[test]
fn forbidden_arrows_are_found() {
    for (name, dependency) in [
        ("espalier-skeleton", "espalier-volume"),
        ("espalier-model", "espalier-tree"),
        ("espalier-geom", "espalier-model"),
        ("espalier-embed", "espalier-pipeline"),
        ("espalier-render", "clap"),
        ("espalier-unheard-of", "glam"),
    ] {
        let crates = BTreeMap::from([(name.to_owned(), vec![dependency.to_owned()])]);
        assert_eq!(violations(&crates).len(), 1, "{name} -> {dependency}");
    }
}
