//! `pipelines/paper.toml` is the method as printed, and a small swarm of it runs to its end.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use espalier_model::{Embedding, TargetKind, swc};
use espalier_pipeline::Config;
use espalier_tests::{run, set};

fn paper_toml() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines/paper.toml")
}

#[test]
fn every_published_value_is_in_the_file() {
    let text = fs::read_to_string(paper_toml()).expect("the file");
    let config = Config::parse(&text, &paper_toml(), &[]).expect("a legal config");
    assert_eq!(config.views, espalier_views::Params::paper());
    assert_eq!(config.embed, espalier_embed::Params::paper());
    assert_eq!(config.render, espalier_render::Params::paper());
    assert_eq!((config.embed.pso.particles, config.embed.pso.iterations), (40_960, 100));
    assert!(!config.embed.solver.mirrors, "the paper has no search of mirrors");
}

#[test]
fn a_small_swarm_runs_as_printed() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let overrides = [
        set("phantom.n_nodes", 100),
        set("embed.pso.particles", 200),
        set("embed.pso.iterations", 10),
        set("views.particles", 20),
        set("views.iterations", 5),
        set("render.width_px", 400),
    ];
    run(&paper_toml(), folder.path(), &overrides, 2).expect("a run");
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("a file of the run");
    let tree = swc::read_tree(&read("tree.swc")).expect("a tree");
    let embedding = Embedding::from_json(&read("embedding.json"), &tree).expect("an embedding");
    assert!(embedding.certificate.holds());
    assert_eq!(embedding.targets.kind, TargetKind::Projected);
    let names: Vec<&str> = embedding.methods.iter().map(|row| row.method.as_str()).collect();
    assert_eq!(names, ["projection", "radial", "cone", "marino", "pso 200x10 s"]);
    assert!(embedding.methods.iter().all(|row| row.targets == TargetKind::Projected));
}
