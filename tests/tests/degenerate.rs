//! Trees at the borders of what a tree can be, through all stages: a certified picture that `verify` cannot fault, or
//! a refusal that says why. Never a panic.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;

use espalier_model::Diagnose;
use espalier_model::diagnose::Class;
use espalier_pipeline::verify;
use espalier_tests::degenerate::cases;
use espalier_tests::{results, run, set, small_swarm};

/// Of the full size: chains of 400 nodes, stars of 4 and 40, a binary tree of 8 levels.
const SHARE: f64 = 0.004;
/// Coordinates beyond 1e9 mm are refused by name; everything else is drawn.
const REFUSED: [&str; 1] = ["scale 1e9"];

#[test]
fn every_degenerate_tree_is_drawn_or_refused_with_the_reason() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut overrides = small_swarm();
    overrides.extend([set("embed.solver.effort", 0.05), set("input.unit", "mm")]);
    let mut refused = Vec::new();
    for (idx, (name, swc)) in cases(SHARE).into_iter().enumerate() {
        let file = folder.path().join(format!("{idx}.swc"));
        fs::write(&file, swc).expect("write");
        let out = folder.path().join(idx.to_string());
        match run(&file, &out, &overrides, 2) {
            Ok(_) => {
                assert!(results(&out).1.certificate.holds(), "{name}");
                let failed = verify(&out, Some(2)).expect("a readable folder").verdict();
                assert!(failed.is_ok(), "{name}: {failed:?}");
            }
            Err(error) => {
                let is_told = matches!(error.class(), Class::Input | Class::Uncertified);
                assert!(is_told && !error.hint().is_empty(), "{name}: {error}");
                refused.push(name);
            }
        }
    }
    assert_eq!(refused, REFUSED);
}
