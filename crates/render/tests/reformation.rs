//! The scan on the map, against scans whose every value is known.
#![allow(clippy::expect_used, reason = "a test that cannot go on must fail")]

mod common;

use common::{flat, front, node};
use espalier_model::{Embedding, Grid, Node, Tree, ViewHierarchy, Volume, Voxels};
use espalier_render::{Error, Fit, Params, Rendered, Slab, Style, VolumeParams, Window, render, render_scan};
use exr::prelude::{ReadChannels, ReadLayers};
use glam::{DAffine3, DVec2, DVec3};
use ndarray::Array3;

/// A Y in the plane of x and z: a stem, a bent left arm, a right arm. By node: x, z, radius, parent.
const FORK: [(f64, f64, f64, Option<usize>); 6] = [
    (0.0, 0.0, 3.0, None),
    (0.0, -20.0, 3.0, Some(0)),
    (-10.0, -32.0, 2.5, Some(1)),
    (-13.0, -48.0, 2.5, Some(2)),
    (12.0, -30.0, 2.0, Some(1)),
    (20.0, -44.0, 2.0, Some(4)),
];
/// What fills the stem, the left and the right arm.
const FILLED: [f64; 3] = [100.0, 200.0, 300.0];

/// The plane that the Y lies in: its right, and its up.
#[derive(Clone, Copy)]
struct Tilt {
    right: DVec3,
    up: DVec3,
}

/// As it stands, and in a plane that no axis is parallel to.
const TILTS: [Tilt; 2] = [
    Tilt { right: DVec3::X, up: DVec3::Z },
    Tilt { right: DVec3::new(0.6, 0.0, 0.8), up: DVec3::new(-0.48, 0.8, 0.36) },
];
const ORIGIN: DVec3 = DVec3::new(3.0, -5.0, 7.0);

impl Tilt {
    fn patient(&self, plane: DVec2) -> DVec3 {
        ORIGIN + self.right * plane.x + self.up * plane.y
    }

    fn plane(&self, patient: DVec3) -> DVec2 {
        let away = patient - ORIGIN;
        DVec2::new(away.dot(self.right), away.dot(self.up))
    }

    /// The tree, its embedding as its own plane has it, and a view.
    fn fork(&self) -> (Tree, Embedding, ViewHierarchy) {
        let nodes = FORK.map(|(x, z, radius_mm, parent)| Node {
            position_mm: self.patient(DVec2::new(x, z)),
            radius_mm,
            parent,
            kind: 0,
        });
        let (tree, order) = Tree::with_order(&nodes).expect("a tree");
        let mut embedding = flat(&tree);
        embedding.positions_mm = order.iter().map(|&old| DVec2::new(FORK[old].0, FORK[old].1)).collect();
        let views = front(&tree);
        (tree, embedding, views)
    }
}

/// A scan of 0.8 × 0.6 × 0.7 mm on a grid that is parallel to nothing, with these values.
fn scan_of(tilt: Tilt, value: impl Fn(DVec3) -> f64) -> Volume {
    let (s, c) = (0.28, 0.96);
    let spacing = DVec3::new(0.8, 0.6, 0.7);
    let (x, y, z) = (DVec3::new(c, s, 0.0), DVec3::new(0.0, 0.0, -1.0), DVec3::new(-s, c, 0.0));
    let shape = [100_usize, 120, 100];
    let axes = [x * spacing.x, y * spacing.y, z * spacing.z];
    let middle = tilt.patient(DVec2::new(3.0, -24.0));
    let half = (0..3).map(|axis| axes[axis] * (shape[axis] as f64 - 1.0) / 2.0).sum::<DVec3>();
    let affine = DAffine3::from_cols(axes[0], axes[1], axes[2], middle - half);
    let grid = Grid::new(shape, affine).expect("a grid");
    let at = |x: usize, y: usize, z: usize| affine.transform_point3(DVec3::new(x as f64, y as f64, z as f64));
    let values = Array3::from_shape_fn((shape[2], shape[1], shape[0]), |(z, y, x)| value(at(x, y, z)) as f32);
    Volume::new(grid, Voxels::F32(values), 1.0, 0.0)
}

/// The value that fills the branch that a point is in the middle of.
fn filled(tilt: Tilt, patient: DVec3) -> f64 {
    let plane = tilt.plane(patient);
    let off = patient.distance(tilt.patient(plane));
    let distance = |from: usize, to: usize| {
        let (a, b) = (DVec2::new(FORK[from].0, FORK[from].1), DVec2::new(FORK[to].0, FORK[to].1));
        let share = ((plane - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        plane.distance(a.lerp(b, share)).hypot_with(off)
    };
    let branches = [distance(0, 1), distance(1, 2).min(distance(2, 3)), distance(1, 4).min(distance(4, 5))];
    let (branch, nearest) =
        (0..3).map(|i| (i, branches[i])).min_by(|a, b| a.1.total_cmp(&b.1)).expect("three");
    if nearest < 3.5 { FILLED[branch] } else { -50.0 }
}

/// √(a² + b²).
trait Hypot {
    fn hypot_with(self, other: f64) -> f64;
}

impl Hypot for f64 {
    fn hypot_with(self, other: f64) -> f64 {
        (self * self + other * other).sqrt()
    }
}

fn params(volume: VolumeParams) -> Params {
    Params { width_px: 480, style: Style::Volume, pdf: false, volume, ..Params::default() }
}

fn with_window(low: f64, high: f64) -> VolumeParams {
    VolumeParams { window: Window::Range([low, high]), ..VolumeParams::default() }
}

fn drawn(tilt: Tilt, scan: &Volume, params: &Params) -> Rendered {
    let (tree, embedding, views) = tilt.fork();
    render_scan((&tree, &embedding, &views), scan, params).expect("a picture")
}

/// A covered pixel, as the EXR has it.
struct Read {
    plane: DVec2,
    position: DVec3,
    value: f64,
    branch: usize,
    arc_mm: f64,
    across_mm: f64,
}

/// The covered pixels of an EXR, read by another library than wrote its blocks, and where each lies in the plane.
fn pixels(exr: &[u8]) -> Vec<Read> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(exr))
        .expect("a readable EXR");
    let layer = &image.layer_data;
    let comment = layer.attributes.comments.as_ref().expect("a comment").to_string();
    let number = |after: &str| -> f64 {
        let rest = comment.split_once(after).expect(after).1.trim_start();
        rest.split([' ', ')', ',', ';']).next().and_then(|text| text.parse().ok()).expect("a number")
    };
    let origin = DVec2::new(number("plane_x_mm = (x + 0.5 - "), number("plane_y_mm = ("));
    let mm_per_px = number(") * ");
    let (sin, cos) = espalier_geom::math::sin_cos(number("turned by ").to_radians());
    let width = layer.size.0;
    let channels: Vec<(String, Vec<f32>)> = layer
        .channel_data
        .list
        .iter()
        .map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect()))
        .collect();
    let channel = |name: &str| &channels.iter().find(|(known, _)| known == name).expect(name).1;
    let at = |i: usize| {
        let away =
            DVec2::new((i % width) as f64 + 0.5 - origin.x, origin.y - (i / width) as f64 - 0.5) * mm_per_px;
        DVec2::new(cos, -sin).rotate(away)
    };
    let covered = (0..channel("A").len()).filter(|&i| channel("A")[i] > 0.0);
    let background = (0..channel("A").len()).filter(|&i| channel("A")[i] == 0.0);
    assert!(
        background.clone().count() > 100 && background.clone().all(|i| channel("volume.value")[i].is_nan())
    );
    covered
        .map(|i| Read {
            plane: at(i),
            position: DVec3::from_array(
                ["X", "Y", "Z"].map(|a| f64::from(channel(&format!("position.{a}"))[i])),
            ),
            value: f64::from(channel("volume.value")[i]),
            branch: channel("branch.id")[i] as usize,
            arc_mm: f64::from(channel("arc.mm")[i]),
            across_mm: f64::from(channel("across.mm")[i]),
        })
        .collect()
}

#[test]
fn each_branch_shows_what_fills_it_where_it_lies() {
    for tilt in TILTS {
        let scan = scan_of(tilt, |patient| filled(tilt, patient));
        let read = pixels(&drawn(tilt, &scan, &params(VolumeParams::default())).exr.expect("layers"));
        let mut n_of_branch = [0; 3];
        for pixel in &read {
            // Of a flat tree the map is its plane.
            let expected = tilt.patient(pixel.plane);
            assert!(pixel.position.distance(expected) < 0.01, "{} {expected}", pixel.position);
            // Away from the walls and from the other branches a voxel is as its neighbours.
            if pixel.across_mm.abs() < 1.0
                && pixel.plane.y > -43.0
                && pixel.arc_mm > 2.0
                && (pixel.arc_mm - 20.0).abs() > 5.0
            {
                // Branch 1 is the longer arm or the shorter one, as the tree has ordered them.
                let branch = usize::from(pixel.arc_mm > 20.0) * if pixel.plane.x < 0.0 { 1 } else { 2 };
                assert!((pixel.value - FILLED[branch]).abs() < 1e-3, "{} {}", pixel.plane, pixel.value);
                assert_eq!(pixel.branch == 0, branch == 0);
                n_of_branch[branch] += 1;
            }
        }
        assert!(n_of_branch.iter().all(|&n| n > 300), "{n_of_branch:?}");
    }
}

#[test]
fn a_gradient_runs_the_same_way_through_parent_and_children() {
    for tilt in TILTS {
        // Linear in space, so that interpolation is exact and every sign is seen.
        let value = |patient: DVec3| {
            let plane = tilt.plane(patient);
            10.0 * plane.x + 3.0 * plane.y
        };
        let scan = scan_of(tilt, value);
        for fit in [Fit::Upright, Fit::Turned] {
            let params = Params { fit, aspect: Some(0.6), ..params(with_window(-500.0, 500.0)) };
            let read = pixels(&drawn(tilt, &scan, &params).exr.expect("layers"));
            assert!(read.len() > 5000, "{}", read.len());
            for pixel in &read {
                let expected = 10.0 * pixel.plane.x + 3.0 * pixel.plane.y;
                assert!((pixel.value - expected).abs() < 0.05, "{} {} {expected}", pixel.plane, pixel.value);
            }
        }
    }
}

#[test]
fn a_plaque_shows_at_its_place_and_on_its_side() {
    let tilt = TILTS[1];
    // On the outer wall of the right arm, half way along its first edge.
    let along = DVec2::new(12.0, -10.0).normalize();
    let place = DVec2::new(6.0, -25.0) + 2.0 * along.perp();
    let scan =
        scan_of(tilt, |patient| if patient.distance(tilt.patient(place)) < 1.2 { 900.0 } else { 50.0 });
    let read = pixels(&drawn(tilt, &scan, &params(VolumeParams::default())).exr.expect("layers"));
    let plaque: Vec<&Read> = read.iter().filter(|pixel| pixel.value > 500.0).collect();
    assert!(plaque.len() > 30, "{}", plaque.len());
    let arc_mm = 20.0 + DVec2::new(6.0, -5.0).length();
    for pixel in plaque {
        assert!(pixel.plane.distance(place) < 1.6, "{} {place}", pixel.plane);
        assert!(
            (pixel.arc_mm - arc_mm).abs() < 1.6 && (pixel.across_mm - 2.0).abs() < 1.6,
            "{}",
            pixel.arc_mm
        );
    }
}

#[test]
fn a_slab_finds_what_lies_off_the_surface() {
    let tilt = TILTS[0];
    // A bead 3 mm before the stem, as seen on the map, and a hole as far behind it.
    let normal = tilt.right.cross(tilt.up);
    let spot = |patient: DVec3, off_mm: f64| {
        patient.distance(tilt.patient(DVec2::new(0.0, -8.0)) + normal * off_mm) < 1.5
    };
    let scan = scan_of(tilt, |patient| match (spot(patient, 3.0), spot(patient, -3.0)) {
        (true, _) => 800.0,
        (_, true) => -700.0,
        _ => 40.0,
    });
    let range = |slab_mm: f64, slab: Slab| {
        let volume = VolumeParams { slab_mm, slab, ..VolumeParams::default() };
        let read = pixels(&drawn(tilt, &scan, &params(volume)).exr.expect("layers"));
        let values = || read.iter().map(|pixel| pixel.value).filter(|value| value.is_finite());
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    };
    assert_eq!(range(0.0, Slab::Mip), (40.0, 40.0));
    assert_eq!(range(8.0, Slab::Mip), (40.0, 800.0));
    assert_eq!(range(8.0, Slab::Minip), (-700.0, 40.0));
    let (least, most) = range(8.0, Slab::Mean);
    assert!(least > -300.0 && most < 400.0, "{least} {most}");
}

#[test]
fn where_there_is_no_value_there_is_paper() {
    let tilt = TILTS[1];
    let (tree, embedding, views) = tilt.fork();
    // No numbers on the right arm's end, and all else at the lower end of the window.
    let cut = |patient: DVec3| tilt.plane(patient).x > 15.0;
    let scan = scan_of(tilt, |patient| if cut(patient) { f64::NAN } else { 0.0 });
    let made =
        render_scan((&tree, &embedding, &views), &scan, &params(with_window(0.0, 100.0))).expect("a picture");
    let read = pixels(made.exr.as_deref().expect("layers"));
    for pixel in &read {
        // A voxel on either side of the cut may go either way.
        if pixel.plane.x > 17.0 {
            assert!(pixel.value.is_nan(), "{} {}", pixel.plane, pixel.value);
        } else if pixel.plane.x < 14.0 {
            assert_eq!(pixel.value, 0.0, "{}", pixel.plane);
        }
    }
    assert!(made.report.get("scan_shown_percent").is_some_and(|percent| (50.0..99.0).contains(&percent)));
    // Black stands for 0; where there is nothing, the paper is white but for the line round the branch.
    let picture = image::load_from_memory(&made.png).expect("a PNG").to_rgb8();
    let n_black = picture.pixels().filter(|pixel| pixel.0.iter().all(|&part| part < 10)).count();
    assert!(n_black > 5000, "{n_black}");
}

#[test]
fn a_scan_of_something_else_is_refused() {
    let tilt = TILTS[0];
    let (tree, embedding, views) = tilt.fork();
    let subject = (&tree, &embedding, &views);
    let far = |patient: DVec3| patient.x;
    let here = scan_of(tilt, far);
    let grid = here.grid();
    let moved = |by: DVec3| {
        let affine = grid.world_from_voxel();
        let affine = DAffine3 { translation: affine.translation + by, ..affine };
        Volume::new(Grid::new(grid.shape(), affine).expect("a grid"), here.voxels().clone(), 1.0, 0.0)
    };
    let drawn = |by: DVec3| render_scan(subject, &moved(by), &params(VolumeParams::default()));
    let error = drawn(DVec3::new(0.0, 0.0, 200.0)).expect_err("it lies elsewhere");
    assert!(matches!(error, Error::Elsewhere { percent, .. } if percent == 0.0), "{error}");
    // Most of it lies there: drawn, and said.
    let most = drawn(DVec3::new(0.0, 0.0, 24.0)).expect("a picture");
    assert!(most.report.warnings.iter().any(|warning| warning.code == "W-RENDER-OUTSIDE"));
    let error = render(&tree, &embedding, &views, &params(VolumeParams::default())).expect_err("no scan");
    assert!(matches!(error, Error::NoScan), "{error}");
}

#[test]
fn settings_out_of_range_are_named() {
    let legal = VolumeParams::default();
    for (volume, key) in [
        (VolumeParams { reach_mm: -1.0, ..legal.clone() }, "volume.reach_mm"),
        (VolumeParams { reach_radii: f64::NAN, ..legal.clone() }, "volume.reach_radii"),
        (VolumeParams { slab_mm: 101.0, ..legal.clone() }, "volume.slab_mm"),
        (with_window(200.0, 200.0), "volume.window"),
        (with_window(f64::NAN, 200.0), "volume.window"),
        (with_window(0.0, f64::INFINITY), "volume.window"),
    ] {
        let error = params(volume).validate().expect_err(key);
        assert_eq!(error.key, key);
    }
    params(legal).validate().expect("the defaults are legal");
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let tilt = TILTS[1];
    let scan = scan_of(tilt, |patient| 7.0 * patient.x + 20.0 * (patient.y - patient.z));
    let volume = VolumeParams { slab_mm: 3.0, ..VolumeParams::default() };
    let params = Params { pdf: true, ..params(volume) };
    let on = |n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
        pool.install(|| drawn(tilt, &scan, &params))
    };
    let alone = on(1);
    assert!(alone == on(3), "another picture on three threads");
    // The vector formats have the greys as an image and the branches as paths.
    assert!(alone.svg.contains("<image id=\"scan\"") && alone.svg.contains("id=\"branch-2\""));
    let svg = roxmltree::Document::parse(&alone.svg).expect("XML");
    assert_eq!(svg.descendants().filter(|node| node.attribute("fill-opacity") == Some("0")).count(), 3);
    assert!(alone.pdf.is_some_and(|pdf| pdf.starts_with(b"%PDF")));
}

#[test]
fn degenerate_trees_show_their_scan() {
    let ball = Tree::new(&[node(0.0, 0.0, -20.0, 3.0, None)]).expect("a tree");
    let straight =
        Tree::new(&[node(0.0, 0.0, 0.0, 0.0, None), node(0.0, 0.0, -30.0, 0.0, Some(0))]).expect("a tree");
    let tilt = TILTS[0];
    let scan = scan_of(tilt, |patient| patient.z);
    for tree in [ball, straight] {
        for reach_mm in [0.0, 3.0] {
            let volume = VolumeParams { reach_mm, ..VolumeParams::default() };
            let made = render_scan((&tree, &flat(&tree), &front(&tree)), &scan, &params(volume));
            assert!(made.is_ok(), "{:?}", made.err());
        }
    }
}
