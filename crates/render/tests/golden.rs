//! Small pictures, one thing each, compared pixel by pixel with `tests/golden/NAME.png`.
//!
//! `UPDATE_GOLDEN=1` writes them anew. A difference leaves `expected | actual | difference` in
//! `target/golden-render/NAME.png`.
#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on must fail")]
#![allow(clippy::disallowed_methods, reason = "UPDATE_GOLDEN is read here and nowhere else")]

mod common;

use std::path::PathBuf;

use common::{fern, flat, front, node, tube};
use espalier_model::Tree;
use espalier_render::{ColorBy, Params, Style, Theme, render};
use image::{Rgb, RgbImage};

/// The largest golden, in bytes.
const MAX_BYTES: usize = 20 * 1024;

fn check(name: &str, png: &[u8]) {
    assert!(png.len() <= MAX_BYTES, "{name} has {} bytes", png.len());
    let manifest = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let path = manifest.join("tests/golden").join(format!("{name}.png"));
    if std::env::var("UPDATE_GOLDEN").is_ok_and(|value| value == "1") {
        std::fs::write(&path, png).expect("a golden written");
        return;
    }
    let stored = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let decode = |bytes: &[u8]| image::load_from_memory(bytes).expect("a PNG").to_rgb8();
    let (expected, actual) = (decode(&stored), decode(png));
    if expected == actual {
        return;
    }
    let folder = manifest.join("../../target/golden-render");
    std::fs::create_dir_all(&folder).expect("a folder");
    let shown = folder.join(format!("{name}.png"));
    side_by_side(&expected, &actual).save(&shown).expect("a picture written");
    panic!("{name} differs from its golden: see {}", shown.display());
}

/// Expected, actual, and the difference, stretched so that one step in 255 is seen.
fn side_by_side(expected: &RgbImage, actual: &RgbImage) -> RgbImage {
    let (width, height) = (expected.width().max(actual.width()), expected.height().max(actual.height()));
    let missing = Rgb([255, 0, 255]);
    let at = |image: &RgbImage, x, y| image.get_pixel_checked(x, y).copied().unwrap_or(missing);
    RgbImage::from_fn(3 * width, height, |x, y| {
        let (e, a) = (at(expected, x % width, y), at(actual, x % width, y));
        match x / width {
            0 => e,
            1 => a,
            _ => Rgb(std::array::from_fn(|k| e[k].abs_diff(a[k]).saturating_mul(16))),
        }
    })
}

fn tiny() -> Params {
    Params { width_px: 240, exr: false, ..Params::default() }
}

/// A trunk, a fork of a thick and a thin branch, a bend.
fn fork() -> Tree {
    Tree::new(&[
        node(0.0, 0.0, 0.0, 4.0, None),
        node(0.0, 0.0, -14.0, 3.5, Some(0)),
        node(-9.0, 0.0, -22.0, 2.6, Some(1)),
        node(-11.0, 0.0, -34.0, 2.2, Some(2)),
        node(8.0, 0.0, -20.0, 1.2, Some(1)),
        node(20.0, 0.0, -21.0, 0.4, Some(4)),
    ])
    .expect("a tree")
}

#[test]
fn junction_bend_and_taper() {
    let tree = fork();
    check("fork", &render(&tree, &flat(&tree), &front(&tree), &tiny()).expect("pictures").png);
}

#[test]
fn dark_lines_by_branch() {
    let tree = fern(2, 3, 1.0);
    let params = Params {
        style: Style::Line,
        theme: Theme::Dark,
        color_by: ColorBy::Branch,
        title: Some("Lines".to_owned()),
        ..tiny()
    };
    check("lines", &render(&tree, &flat(&tree), &front(&tree), &params).expect("pictures").png);
}

#[test]
fn a_branch_in_front_leaves_a_gap_and_letters_tell_the_sides() {
    // A bar that passes 8 mm in front of the trunk.
    let tree = Tree::new(&[
        node(0.0, 0.0, 0.0, 2.0, None),
        node(0.0, 0.0, -40.0, 2.0, Some(0)),
        node(16.0, 0.0, -40.0, 1.5, Some(1)),
        node(16.0, 8.0, -16.0, 1.5, Some(2)),
        node(-16.0, 8.0, -16.0, 1.5, Some(3)),
    ])
    .expect("a tree");
    let rendered = render(&tree, &flat(&tree), &front(&tree), &tiny()).expect("pictures");
    check("global-view", &rendered.global_view_png);
}

#[test]
fn the_legend_has_room() {
    let tree = tube(60.0, [1.5, 0.7]);
    let params = Params { width_px: 480, ..tiny() };
    check("legend", &render(&tree, &flat(&tree), &front(&tree), &params).expect("pictures").png);
}
