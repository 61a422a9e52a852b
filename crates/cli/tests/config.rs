//! `espalier config`: the schema against configs that are used, keys explained, configs to start with.
#![allow(clippy::expect_used, clippy::panic, reason = "a test says what it expects")]

mod program;
mod schema;

use std::fs;
use std::path::Path;

use program::{espalier, stderr};
use schema::faults;
use serde_json::Value;

fn said(arguments: &[&str]) -> String {
    let folder = tempfile::tempdir().expect("temporary folder");
    let output = espalier(folder.path(), arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    String::from_utf8(output.stdout).expect("text")
}

fn config_schema() -> Value {
    serde_json::from_str(&said(&["config", "schema"])).expect("JSON")
}

fn json_of(toml_text: &str) -> Value {
    let table: toml::Table = toml::from_str(toml_text).expect("TOML");
    serde_json::to_value(table).expect("JSON")
}

fn read(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)).expect(path)
}

#[test]
fn configs_in_use_are_legal() {
    let schema = config_schema();
    for file in ["airway", "vessel", "neuron", "paper"] {
        let config = read(&format!("pipelines/{file}.toml"));
        assert_eq!(faults(&schema, &json_of(&config)), Vec::<String>::new(), "{file}");
        let template = said(&["config", "init", file]);
        assert_eq!(faults(&schema, &json_of(&template)), Vec::<String>::new(), "{file}");
    }
}

#[test]
fn what_the_program_refuses_the_schema_refuses() {
    let schema = config_schema();
    for (key, value) in [
        ("tree", "prune_factr = 1.0"),
        ("tree", "prune_factor = 11"),
        ("tree", "prune_factor = \"thick\""),
        ("tree", "tolerance = 0"),
        ("tree", "components = \"some\""),
        ("tree", "root_mm = [1.0, 2.0]"),
        ("volume", "components = 0"),
        ("volume", "resample_mm = \"fine\""),
        ("embed", "methods = [\"solver\", \"magic\"]"),
        ("embed", "w_crossing = -1.0"),
        ("embed.pso", "particles = 0"),
        ("render", "width_px = 100"),
        ("render.volume", "window = [1.0]"),
        ("tre", "x = 1"),
    ] {
        let text = format!("schema = 1\n[input]\nphantom = \"neuron\"\n[{key}]\n{value}\n");
        assert!(!faults(&schema, &json_of(&text)).is_empty(), "the schema takes {value}");
        let folder = tempfile::tempdir().expect("temporary folder");
        fs::write(folder.path().join("a.toml"), text).expect("write");
        let output = espalier(folder.path(), &["run", "a.toml", "--dry-run"]);
        assert_eq!(output.status.code(), Some(2), "{value}: {}", stderr(&output));
    }
    for value in [
        "tree.prune_factor = 10",
        "volume.components = 3",
        "volume.label = [1, \"trachea\"]",
        "embed.w_crossing = 2",
    ] {
        assert_eq!(faults(&schema, &json_of(value)), Vec::<String>::new(), "{value}");
    }
}

/// What the guide shows are keys that there are, with values that they may have.
#[test]
fn the_guide_is_legal() {
    let (schema, guide) = (config_schema(), read("pipelines/README.md"));
    let blocks: Vec<&str> =
        guide.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert!(blocks.len() > 5, "{}", blocks.len());
    for block in blocks {
        assert_eq!(faults(&schema, &json_of(block)), Vec::<String>::new(), "{block}");
    }
}

/// Keys that the texts on error codes name are keys that there are.
#[test]
fn codes_name_keys_that_there_are() {
    let keys: Vec<Value> = serde_json::from_str(&said(&["config", "explain", "--json"])).expect("JSON");
    let keys: Vec<&str> = keys.iter().map(|key| key["key"].as_str().expect("a key")).collect();
    let sections =
        ["input", "phantom", "volume", "skeleton", "radius", "tree", "views", "embed", "render", "report"];
    // `volume.value` is a channel of the EXR.
    let is_file = |word: &str| {
        let ends = [".swc", ".json", ".tsv", ".toml", ".vtp", ".graphml", ".html"];
        ends.iter().any(|end| word.ends_with(end)) || word == "volume.value"
    };
    let mut n_named = 0;
    for text in [said(&["explain", "--json"]), read("pipelines/README.md"), read("README.md")] {
        for word in text.split(|c: char| !(c.is_ascii_alphanumeric() || "._".contains(c))) {
            let word = word.trim_end_matches('.');
            let Some((section, _)) = word.split_once('.') else { continue };
            if sections.contains(&section) && !is_file(word) {
                let is_there = keys.iter().any(|key| *key == word || key.starts_with(&format!("{word}.")));
                assert!(is_there, "there is no key {word}");
                n_named += 1;
            }
        }
    }
    assert!(n_named > 60, "{n_named}");
}

#[test]
fn keys_are_explained() {
    let text = said(&["config", "explain", "tree.components"]);
    for part in ["tree.components\n", "default \"join\"", "\n  refuse ", "Refuse the skeleton"] {
        assert!(text.contains(part), "no {part:?} in: {text}");
    }
    let section = said(&["config", "explain", "embed.pso"]);
    assert!(section.contains("embed.pso.particles ") && !section.contains("embed.w_angle"), "{section}");
    let folder = tempfile::tempdir().expect("temporary folder");
    let output = espalier(folder.path(), &["config", "explain", "tree.prune_factr"]);
    assert_eq!(output.status.code(), Some(2));
    let text = stderr(&output);
    assert!(
        text.contains("error[E-EXPLAIN-KEY]") && text.contains("did you mean tree.prune_factor"),
        "{text}"
    );
}

#[test]
fn the_program_tells_what_it_is() {
    let info: Value =
        serde_json::from_str(&said(&["info", "--json", "--threads", "3", "--max-memory", "2G"]))
            .expect("JSON");
    assert_eq!(info["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!((&info["threads"], &info["max_memory_bytes"]), (&Value::from(3), &Value::from(2_u64 << 30)));
    let stages: Vec<&str> = info["stages"]
        .as_array()
        .expect("stages")
        .iter()
        .filter_map(|stage| stage["name"].as_str())
        .collect();
    assert_eq!((stages.first(), stages.last()), (Some(&"phantom"), Some(&"report")));
    let text = said(&["info"]);
    for stage in stages {
        assert!(text.contains(&format!("\n  {stage} ")), "{stage}");
    }
    assert!(text.contains("NRRD") && text.contains("phantom_voxels"), "{text}");
}

#[test]
fn a_config_to_start_with_is_never_written_over() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let init = ["config", "init", "neuron", "-o", "my.toml"];
    assert_eq!(espalier(folder.path(), &init).status.code(), Some(0));
    let before = fs::read_to_string(folder.path().join("my.toml")).expect("text");
    let output = espalier(folder.path(), &init);
    assert_eq!(output.status.code(), Some(73), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(folder.path().join("my.toml")).expect("text"), before);
    // It runs as it is, once its input is there.
    fs::write(folder.path().join("neuron.swc"), "1 1 0 0 0 1 -1\n2 3 0 9 0 1 1\n3 3 4 15 0 1 2\n")
        .expect("write");
    let run = espalier(folder.path(), &["run", "my.toml", "--to", "tree"]);
    assert_eq!(run.status.code(), Some(0), "{}", stderr(&run));
}
