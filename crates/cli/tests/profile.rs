//! The calibre on a way, as its user meets it.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use program::{espalier, stderr};

/// A tube of radius 2 that bends, with a narrow place of radius 1 at 30 mm, and a fork at 60 mm.
fn tube() -> String {
    let mut swc = "1 1 0 0 0 2 -1\n".to_owned();
    for i in 1..=60 {
        let radius = if (29..=31).contains(&i) { 1.0 } else { 2.0 };
        let _ = writeln!(swc, "{} 3 0 {} {:.1} {radius} {i}", i + 1, -i, f64::from(i % 2));
    }
    swc + "62 3 5 -66 0 1.2 61\n63 3 12 -75 0 1.2 62\n64 3 -5 -66 0 1.2 61\n65 3 -12 -75 0 1.2 64\n"
}

fn said(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = espalier(folder, arguments);
    let out = String::from_utf8_lossy(&output.stdout).into_owned();
    (output.status.code(), if output.status.success() { out } else { stderr(&output) })
}

#[test]
fn a_way_is_drawn_and_no_result_is_overwritten() {
    let folder = tempfile::tempdir().expect("temporary folder");
    fs::write(folder.path().join("tube.swc"), tube()).expect("writable");
    let quick = ["input.unit=mm", "embed.pso.particles=16", "embed.pso.iterations=3", "render.width_px=400"];
    let quick: Vec<&str> = quick.iter().flat_map(|set| ["--set", set]).collect();
    let (code, text) =
        said(folder.path(), &[&["run", "tube.swc", "-o", "run", "-q"], quick.as_slice()].concat());
    assert_eq!(code, Some(0), "{text}");

    let draw = |file: &str, more: &[&str]| {
        said(folder.path(), &[&["profile", "run", "--branch", "1", "--plot", file], more].concat())
    };
    let (code, text) = draw("plots/way.svg", &[]);
    assert!(code == Some(0) && text.starts_with("narrowest 50.0 % at "), "{text}");
    assert!(text.contains("branch 0") && text.contains("radius 1.0000 mm of 2.0000"), "{text}");
    let svg = fs::read_to_string(folder.path().join("plots/way.svg")).expect("a plot");
    for said in ["Calibre to the tip of branch 1", ">−50 %<", ">0 (0)<", ">1 (1)<", "narrow place"] {
        assert!(svg.contains(said), "{said}");
    }
    // The input's name may be a patient's.
    assert!(!svg.contains("tube"), "{svg}");

    assert_eq!(draw("way.PNG", &["--set", "render.theme=dark"]).0, Some(0));
    assert!(fs::read(folder.path().join("way.PNG")).expect("a plot").starts_with(b"\x89PNG"));
    for (file, more) in [
        ("way.pdf", [].as_slice()),
        ("way", &[]),
        ("run/planar.png", &[]),
        ("run/../run/compare.svg", &[]),
        ("other.svg", &["--set", "embed.w_angle=2"]),
        ("other.svg", &["--set", "render.width_px=3"]),
    ] {
        let (code, text) = draw(file, more);
        assert_eq!(code, Some(2), "{file}: {text}");
        assert!(!more.is_empty() || text.contains("error[E-PROFILE-PLOT]"), "{file}: {text}");
    }
    assert_eq!(said(folder.path(), &["verify", "run", "-q"]).0, Some(0));
}
