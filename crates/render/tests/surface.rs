//! What the EXR says, against closed forms and against the tree.
#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on must fail")]

mod common;

use common::{fern, flat, front, node, tube};
use espalier_model::{Embedding, Tree};
use espalier_render::{Params, render};
use exr::prelude::{ReadChannels, ReadLayers};
use glam::{DVec2, DVec3};

/// An EXR read back by name.
struct Layers {
    width: usize,
    height: usize,
    channels: Vec<(String, Vec<f32>)>,
    comment: String,
}

impl Layers {
    fn of(tree: &Tree, embedding: &Embedding, params: &Params) -> Self {
        let rendered = render(tree, embedding, &front(tree), params).expect("pictures");
        let bytes = rendered.exr.expect("an EXR");
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(std::io::Cursor::new(bytes))
            .expect("a readable EXR");
        let layer = image.layer_data;
        let read = |channel: &exr::image::AnyChannel<exr::image::FlatSamples>| {
            (channel.name.to_string(), channel.sample_data.values_as_f32().collect())
        };
        Self {
            width: layer.size.0,
            height: layer.size.1,
            channels: layer.channel_data.list.iter().map(read).collect(),
            comment: layer.attributes.comments.expect("a comment").to_string(),
        }
    }

    fn at(&self, name: &str, x: usize, y: usize) -> f64 {
        let (_, samples) = self.channels.iter().find(|(channel, _)| channel == name).expect(name);
        f64::from(samples[y * self.width + x])
    }

    fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let width = self.width;
        (0..width * self.height).map(move |i| (i % width, i / width))
    }

    /// Pixel to plane, from the numbers in the comment.
    fn plane(&self, x: usize, y: usize) -> DVec2 {
        let number = |after: &str, nth: usize| -> f64 {
            let rest = self.comment.split(after).nth(1).expect(after);
            let mut numbers = rest.split([' ', '(', ')', ',', ';']).filter_map(|word| word.parse().ok());
            numbers.nth(nth).expect("a number")
        };
        let (origin_x, mm_per_px) = (number("plane_x_mm =", 1), number("plane_x_mm =", 2));
        let origin_y = number("plane_y_mm =", 0);
        DVec2::new((x as f64 + 0.5 - origin_x) * mm_per_px, (origin_y - y as f64 - 0.5) * mm_per_px)
    }
}

fn small() -> Params {
    Params { width_px: 300, ..Params::default() }
}

#[test]
fn a_straight_tube_has_its_closed_form_height_and_its_place_in_the_patient() {
    // Along x in the plane, but elsewhere in the patient.
    let tree =
        Tree::new(&[node(5.0, -7.0, 2.0, 3.0, None), node(5.0, 33.0, 2.0, 3.0, Some(0))]).expect("a tree");
    let mut embedding = flat(&tree);
    embedding.positions_mm = vec![DVec2::ZERO, DVec2::new(40.0, 0.0)];
    let layers = Layers::of(&tree, &embedding, &small());
    let mut n_inside = 0;
    for (x, y) in layers.pixels() {
        let point = layers.plane(x, y);
        let on_axis = point.x.clamp(0.0, 40.0);
        let distance = point.distance(DVec2::new(on_axis, 0.0));
        let covered = layers.at("A", x, y);
        if distance > 3.3 {
            assert_eq!(covered, 0.0, "{point}");
            assert_eq!([layers.at("branch.id", x, y), layers.at("node.id", x, y)], [-1.0, -1.0]);
            assert_eq!(layers.at("position.Y", x, y), 0.0);
        }
        if distance < 2.8 {
            n_inside += 1;
            assert_eq!(covered, 1.0, "{point}");
            let height = (9.0 - distance * distance).sqrt();
            assert!((layers.at("height.mm", x, y) - height).abs() < 0.02, "{point}");
            // As far along and across as in the plane; to which side of a straight tube is the view's to say.
            let place = DVec3::from_array(["X", "Y", "Z"].map(|k| layers.at(&format!("position.{k}"), x, y)));
            assert!((place.y - (point.x - 7.0)).abs() < 0.01, "{point} {place}");
            assert!(
                (DVec2::new(place.x - 5.0, place.z - 2.0).length() - point.y.abs()).abs() < 0.01,
                "{point} {place}"
            );
            assert!((layers.at("arc.mm", x, y) - on_axis).abs() < 1e-3);
            assert!((layers.at("radius.mm", x, y) - 3.0).abs() < 1e-3);
            assert!((layers.at("across.mm", x, y) - point.y).abs() < 1e-3, "{point}");
            assert_eq!([layers.at("branch.id", x, y), layers.at("node.id", x, y)], [0.0, 1.0]);
            let normal = DVec3::from_array(["X", "Y", "Z"].map(|k| layers.at(&format!("normal.{k}"), x, y)));
            let expected = (point - DVec2::new(on_axis, 0.0)).extend(height) / 3.0;
            assert!(normal.distance(expected) < 0.02, "{point} {normal} {expected}");
        }
    }
    assert!(n_inside > 1000, "{n_inside}");
}

#[test]
fn a_taper_moves_the_radius_and_the_thickest_wins_the_height() {
    let tree = tube(30.0, [4.0, 1.0]);
    let layers = Layers::of(&tree, &flat(&tree), &small());
    for (x, y) in layers.pixels() {
        let point = layers.plane(x, y);
        if point.y.abs() < 0.1 && (1.0..29.0).contains(&point.x) {
            // The highest sphere over x: r² − (x − s)² is largest at s = (x + k r₀)/(1 − k²).
            let k = -0.1;
            let s = ((point.x + k * 4.0) / (1.0 - k * k)).clamp(0.0, 30.0);
            let radius = 4.0 + k * s;
            let height = (radius * radius - (point.x - s) * (point.x - s) - point.y * point.y).sqrt();
            assert!((layers.at("height.mm", x, y) - height).abs() < 0.02, "{point}");
            assert!((layers.at("radius.mm", x, y) - radius).abs() < 0.01, "{point}");
        }
    }
}

#[test]
fn the_surface_has_no_gap_anywhere_along_the_tree() {
    let tree = fern(11, 4, 1.0);
    let embedding = flat(&tree);
    let layers = Layers::of(&tree, &embedding, &Params { width_px: 500, ..Params::default() });
    let origin = layers.plane(0, 0);
    let step = layers.plane(1, 1) - origin;
    let branches = tree.branches();
    for (node, parent) in tree.edges() {
        for i in 0..=10 {
            let point =
                embedding.positions_mm[parent].lerp(embedding.positions_mm[node], f64::from(i) / 10.0);
            let pixel = ((point - origin) / step).round();
            let (x, y) = (pixel.x as usize, pixel.y as usize);
            assert!(layers.at("A", x, y) > 0.99, "a gap at {point}, edge {node}");
            // What the pixel says of the patient is near the point that lies there.
            let there = DVec3::from_array(["X", "Y", "Z"].map(|k| layers.at(&format!("position.{k}"), x, y)));
            let here = tree.position_mm(parent).lerp(tree.position_mm(node), f64::from(i) / 10.0);
            let reach = 2.0 * layers.at("radius.mm", x, y) + 2.0 * step.length();
            assert!(there.distance(here) < reach, "{here} is shown as {there}");
            let branch = branches.of_node(layers.at("node.id", x, y) as usize).map_or(-1.0, |b| b as f64);
            assert_eq!(layers.at("branch.id", x, y), branch);
        }
    }
}

#[test]
fn losses_stand_on_their_edges() {
    let tree = Tree::new(&[
        node(0.0, 0.0, 0.0, 1.0, None),
        node(10.0, 0.0, 0.0, 1.0, Some(0)),
        node(20.0, 0.0, 0.0, 1.0, Some(1)),
    ])
    .expect("a tree");
    let mut embedding = flat(&tree);
    embedding.targets.angle_rad[2] -= 0.1;
    embedding.targets.length_mm[2] = 8.0;
    let layers = Layers::of(&tree, &embedding, &small());
    let mut n_seen = 0;
    for (x, y) in layers.pixels().filter(|&(x, y)| layers.at("A", x, y) > 0.5) {
        let is_second = layers.at("node.id", x, y) == 2.0;
        n_seen += usize::from(is_second);
        let expected = if is_second { [0.1_f64.to_degrees(), 0.25] } else { [0.0, 0.0] };
        assert!((layers.at("loss.angle", x, y) - expected[0]).abs() < 1e-4);
        assert!((layers.at("loss.length", x, y) - expected[1]).abs() < 1e-6);
    }
    assert!(n_seen > 100);
}

#[test]
fn thin_branches_keep_their_least_width() {
    let tree = tube(100.0, [0.0, 0.0]);
    let layers = Layers::of(&tree, &flat(&tree), &Params { min_width_px: 4.0, ..small() });
    let x = layers.width / 2;
    let covered: f64 = (0..layers.height).map(|y| layers.at("A", x, y)).sum();
    assert!((covered - 4.0).abs() < 0.05, "{covered}");
}

#[test]
fn the_channels_are_these() {
    let tree = tube(10.0, [1.0, 1.0]);
    let layers = Layers::of(&tree, &flat(&tree), &small());
    let names: Vec<&str> = layers.channels.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        [
            "A",
            "B",
            "G",
            "R",
            "across.mm",
            "arc.mm",
            "branch.id",
            "height.mm",
            "loss.angle",
            "loss.length",
            "loss.orientation",
            "node.id",
            "normal.X",
            "normal.Y",
            "normal.Z",
            "position.X",
            "position.Y",
            "position.Z",
            "radius.mm"
        ]
    );
}
