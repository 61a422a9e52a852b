//! Small pictures, one thing each, compared byte by byte with `tests/golden/NAME.png`.
//!
//! `UPDATE_GOLDEN=1` writes them anew. A difference leaves `expected | difference | actual` in
//! `target/golden-render/NAME.png`.
#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on must fail")]
#![allow(clippy::disallowed_methods, reason = "UPDATE_GOLDEN is read here and nowhere else")]

mod common;

use std::path::PathBuf;

use common::{fern, flat, front, node, tube};
use espalier_model::{Node, Tree};
use espalier_render::{ColorBy, Compass, Fit, Params, Style, Theme, render, render_scan};
use image::{Rgb, RgbImage};

/// The largest golden, in bytes.
const MAX_BYTES: usize = 30 * 1024;

fn check(name: &str, png: &[u8]) {
    assert!(png.len() <= MAX_BYTES, "{name} has {} bytes", png.len());
    let manifest = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let path = manifest.join("tests/golden").join(format!("{name}.png"));
    if std::env::var("UPDATE_GOLDEN").is_ok_and(|value| value == "1") {
        std::fs::write(&path, png).expect("a golden written");
        return;
    }
    let stored = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    if stored == png {
        return;
    }
    let decode = |bytes: &[u8]| image::load_from_memory(bytes).expect("a PNG").to_rgb8();
    let (expected, actual) = (decode(&stored), decode(png));
    assert!(expected != actual, "{name} has the pixels of its golden in other bytes");
    let folder = manifest.join("../../target/golden-render");
    std::fs::create_dir_all(&folder).expect("a folder");
    let shown = folder.join(format!("{name}.png"));
    side_by_side(&expected, &actual).save(&shown).expect("a picture written");
    panic!("{name} differs from its golden: see {}", shown.display());
}

/// Expected, the difference stretched so that one step in 255 is seen, and actual.
fn side_by_side(expected: &RgbImage, actual: &RgbImage) -> RgbImage {
    let (width, height) = (expected.width().max(actual.width()), expected.height().max(actual.height()));
    let missing = Rgb([255, 0, 255]);
    let at = |image: &RgbImage, x, y| image.get_pixel_checked(x, y).copied().unwrap_or(missing);
    RgbImage::from_fn(3 * width, height, |x, y| {
        let (e, a) = (at(expected, x % width, y), at(actual, x % width, y));
        match x / width {
            0 => e,
            1 => Rgb(std::array::from_fn(|k| e[k].abs_diff(a[k]).saturating_mul(16))),
            _ => a,
        }
    })
}

fn tiny() -> Params {
    Params { width_px: 240, exr: false, pdf: false, ..Params::default() }
}

/// Checks the map of a tree.
fn check_map(name: &str, tree: &Tree, params: &Params) {
    check(name, &render(tree, &flat(tree), &front(tree), params).expect("pictures").png);
}

fn tree(nodes: &[Node]) -> Tree {
    Tree::new(nodes).expect("a tree")
}

/// A trunk, a fork of a thick and a thin branch, a bend.
fn fork() -> Tree {
    tree(&[
        node(0.0, 0.0, 0.0, 4.0, None),
        node(0.0, 0.0, -14.0, 3.5, Some(0)),
        node(-9.0, 0.0, -22.0, 2.6, Some(1)),
        node(-11.0, 0.0, -34.0, 2.2, Some(2)),
        node(8.0, 0.0, -20.0, 1.2, Some(1)),
        node(20.0, 0.0, -21.0, 0.4, Some(4)),
    ])
}

#[test]
fn one_cone() {
    check_map("cone", &tube(40.0, [6.0, 2.0]), &tiny());
}

#[test]
fn a_y_is_round_in_its_corner() {
    let y = [
        node(0.0, 0.0, 0.0, 4.0, None),
        node(0.0, 0.0, -16.0, 4.0, Some(0)),
        node(-11.0, 0.0, -30.0, 3.2, Some(1)),
        node(11.0, 0.0, -30.0, 3.2, Some(1)),
    ];
    check_map("junction", &tree(&y), &tiny());
}

#[test]
fn many_short_cones_are_one_tube() {
    let bent = |i: u32| {
        let (sin, cos) = espalier_geom::math::sin_cos(0.05 * f64::from(i));
        node(20.0 * sin, 0.0, 20.0 * cos, 4.0, i.checked_sub(1).map(|i| i as usize))
    };
    check_map("chain", &tree(&(0..60).map(bent).collect::<Vec<_>>()), &tiny());
}

#[test]
fn bends_are_round_inside() {
    // Turns of 20°, 50°, 90° and back, with a short edge in one of them, and a step in width.
    let bends = [
        node(0.0, 0.0, 0.0, 4.0, None),
        node(14.0, 0.0, 0.0, 4.0, Some(0)),
        node(27.0, 0.0, 5.0, 4.0, Some(1)),
        node(31.0, 0.0, 16.0, 4.0, Some(2)),
        node(30.0, 0.0, 18.0, 4.0, Some(3)),
        node(16.0, 0.0, 22.0, 3.0, Some(4)),
        node(13.0, 0.0, 22.0, 1.5, Some(5)),
        node(4.0, 0.0, 22.0, 1.5, Some(6)),
        node(4.0, 0.0, 9.0, 1.5, Some(7)),
    ];
    check_map("bends", &tree(&bends), &tiny());
}

#[test]
fn a_thin_end_does_not_vanish() {
    check_map("thin-end", &tube(60.0, [3.0, 0.0]), &tiny());
}

#[test]
fn distant_parts_that_touch_have_a_seam() {
    let hook = [
        node(0.0, 0.0, 0.0, 3.0, None),
        node(0.0, 0.0, -50.0, 3.0, Some(0)),
        node(20.0, 0.0, -50.0, 3.0, Some(1)),
        node(20.0, 0.0, -8.0, 3.0, Some(2)),
        node(4.5, 0.0, -8.0, 3.0, Some(3)),
    ];
    check_map("seam", &tree(&hook), &tiny());
}

#[test]
fn junction_bend_and_taper() {
    check_map("fork", &fork(), &tiny());
}

#[test]
fn styles() {
    check_map("style-ribbon", &fork(), &Params { style: Style::Ribbon, ..tiny() });
    check_map("style-line", &fork(), &Params { style: Style::Line, ..tiny() });
}

#[test]
fn a_scan_on_the_map() {
    // Dark inside, walls of 1.5 mm, a bead on the wall of the thick branch, and a gradient around; cut at the right.
    let tree = fork();
    let value = |at: glam::DVec3| {
        let distance = |(node, parent): (usize, usize)| {
            let (a, b) = (tree.position_mm(parent), tree.position_mm(node));
            let share = espalier_geom::space::nearest_parameter(at, a, b);
            let radius = |node: usize| tree.nodes()[node].radius_mm;
            at.distance(a.lerp(b, share)) - (radius(parent) + share * (radius(node) - radius(parent)))
        };
        let outside = tree.edges().map(distance).fold(f64::INFINITY, f64::min);
        let is_bead = at.distance(glam::DVec3::new(-6.5, 0.0, -16.5)) < 1.6;
        match outside {
            _ if is_bead => 400.0,
            o if o < 0.0 => -950.0,
            o if o < 1.5 => 50.0,
            _ => -850.0 + 15.0 * (at.z + 20.0),
        }
    };
    let shape = [66_usize, 20, 90];
    let grid = espalier_model::Grid::axis_aligned(
        shape,
        glam::DVec3::splat(0.6),
        glam::DVec3::new(-20.0, -6.0, -44.0),
    )
    .expect("a grid");
    let at = |[x, y, z]: [usize; 3]| {
        grid.world_from_voxel().transform_point3(glam::DVec3::new(x as f64, y as f64, z as f64))
    };
    let values = ndarray::Array3::from_shape_fn((shape[2], shape[1], shape[0]), |(z, y, x)| {
        value(at([x, y, z])) as f32
    });
    let scan = espalier_model::Volume::new(grid.clone(), espalier_model::Voxels::F32(values), 1.0, 0.0);
    let params = Params { style: Style::Volume, width_px: 320, ..tiny() };
    let made = render_scan((&tree, &flat(&tree), &front(&tree)), &scan, &params).expect("pictures");
    check("style-volume", &made.png);
}

#[test]
fn themes() {
    check_map("theme-dark", &fork(), &Params { theme: Theme::Dark, ..tiny() });
    check_map("theme-print", &fork(), &Params { theme: Theme::Print, ..tiny() });
}

#[test]
fn dark_lines_by_branch() {
    let params = Params {
        style: Style::Line,
        theme: Theme::Dark,
        color_by: ColorBy::Branch,
        title: Some("Lines".to_owned()),
        ..tiny()
    };
    check_map("lines", &fern(2, 3, 1.0), &params);
}

#[test]
fn each_colouring_has_its_legend() {
    let labelled: Vec<Node> =
        fork().nodes().iter().enumerate().map(|(i, n)| Node { kind: [1, 2, 2, 3, 4, 4][i], ..*n }).collect();
    for (name, color_by) in [
        ("branch-radius", ColorBy::BranchRadius),
        ("generation", ColorBy::Generation),
        ("angle-loss", ColorBy::AngleLoss),
        ("length-loss", ColorBy::LengthLoss),
        ("orientation-loss", ColorBy::OrientationLoss),
        ("part", ColorBy::Part),
        ("label", ColorBy::Label),
    ] {
        // Broad lines on a low page show the colours as they are, in small files.
        let (style, aspect) = (Style::Line, Some(0.5));
        let plain = Params { width_px: 480, style, aspect, min_width_px: 7.0, ..tiny() };
        let params = Params { color_by, compass: Compass::None, ..plain };
        let tree = tree(&labelled);
        let mut embedding = flat(&tree);
        embedding.targets.angle_rad[2] -= 0.3;
        embedding.targets.length_mm[5] *= 0.8;
        let made = render(&tree, &embedding, &front(&tree), &params).expect("pictures");
        check(&format!("color-{name}"), &made.png);
    }
}

#[test]
fn a_branch_in_front_leaves_a_gap_and_letters_tell_the_sides() {
    // A bar that passes 8 mm in front of the trunk.
    let tree = tree(&[
        node(0.0, 0.0, 0.0, 2.0, None),
        node(0.0, 0.0, -40.0, 2.0, Some(0)),
        node(16.0, 0.0, -40.0, 1.5, Some(1)),
        node(16.0, 8.0, -16.0, 1.5, Some(2)),
        node(-16.0, 8.0, -16.0, 1.5, Some(3)),
    ]);
    let rendered = render(&tree, &flat(&tree), &front(&tree), &tiny()).expect("pictures");
    check("global-view", &rendered.global_view_png);
}

#[test]
fn the_legend_has_room() {
    check_map("legend", &tube(60.0, [1.5, 0.7]), &Params { width_px: 480, ..tiny() });
}

#[test]
fn the_name_of_a_crowded_root_stands_where_there_is_room() {
    let arm = |i: u32| {
        let (sin, cos) = espalier_geom::math::sin_cos(f64::from(i) * std::f64::consts::TAU / 9.0);
        node(20.0 * cos, 0.0, 20.0 * sin, 1.6, Some(0))
    };
    let star: Vec<Node> = std::iter::once(node(0.0, 0.0, 0.0, 1.6, None)).chain((0..9).map(arm)).collect();
    let params = Params { width_px: 480, style: Style::Line, aspect: Some(0.6), ..tiny() };
    check_map("crowded-root", &tree(&star), &Params { min_width_px: 16.0, ..params });
}

#[test]
fn letters_name_the_edges_and_the_branch_that_strays() {
    // The last arm points at the viewer, and the map lays it to the right.
    let tree = tree(&[
        node(0.0, 0.0, 0.0, 1.5, None),
        node(0.0, 0.0, -30.0, 1.5, Some(0)),
        node(-25.0, 0.0, -40.0, 1.2, Some(1)),
        node(25.0, 0.0, -40.0, 1.2, Some(1)),
        node(25.0, 14.0, -40.0, 1.0, Some(3)),
        node(25.0, 0.0, -52.0, 1.0, Some(3)),
    ]);
    let mut embedding = flat(&tree);
    embedding.positions_mm[4] = embedding.positions_mm[3] + glam::DVec2::new(14.0, 2.0);
    let params = Params { width_px: 480, style: Style::Line, aspect: Some(0.75), ..tiny() };
    check("letters", &render(&tree, &embedding, &front(&tree), &params).expect("pictures").png);
}

#[test]
fn a_slanting_tree_is_turned_into_the_shape_of_its_page() {
    let slanting = tree(&[
        node(0.0, 0.0, 0.0, 2.0, None),
        node(30.0, 0.0, -30.0, 1.5, Some(0)),
        node(50.0, 0.0, -44.0, 1.0, Some(1)),
        node(44.0, 0.0, -50.0, 1.0, Some(1)),
    ]);
    check_map("turned", &slanting, &Params { fit: Fit::Turned, aspect: Some(0.5), ..tiny() });
}
