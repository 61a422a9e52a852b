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

/// Two arms of 30 mm and radius 4 mm that meet at the origin, the second turned by so much to the left.
fn bend(turn_deg: f64) -> Tree {
    let (sin, cos) = espalier_geom::math::sin_cos(turn_deg.to_radians());
    let nodes = [
        node(-30.0, 0.0, 0.0, 4.0, None),
        node(0.0, 0.0, 0.0, 4.0, Some(0)),
        node(30.0 * cos, 0.0, 30.0 * sin, 4.0, Some(1)),
    ];
    Tree::new(&nodes).expect("a tree")
}

/// Two tubes of radius 4 joined in a bend, by how far their axes lie from a point: as `samples` have it.
fn joined(asides: [DVec2; 2]) -> f64 {
    let levels = asides.map(|aside| 16.0 - aside.length_squared());
    let [first, second] = levels;
    let facing = |i: usize| {
        let soft = 0.5 * (levels[i] + (levels[i] * levels[i] + 1.6 * 1.6).sqrt());
        asides[i].extend(soft.sqrt()).normalize()
    };
    let cosine = facing(0).dot(facing(1));
    // Fillets fade over half a radius beyond the outlines.
    let say = asides.map(|aside| (1.0 - (aside.length() - 4.0).max(0.0) / 2.0).clamp(0.0, 1.0));
    let [sin, cos] = [1.0 - cosine, 1.0 + cosine].map(|twice: f64| (0.5 * twice.max(0.0)).sqrt());
    let k = 16.0 * (8.0 * (1.0 - cos)).min(1.4 * sin) * say[0] * say[1];
    let apart = (first - second).abs();
    first.max(second) + if apart < k { (k - apart) * (k - apart) / (4.0 * k) } else { 0.0 }
}

#[test]
fn a_bend_has_its_closed_form_inside_and_is_a_ball_outside() {
    for turn_deg in [10.0_f64, 20.0, 38.0, 60.0, 90.0] {
        let tree = bend(turn_deg);
        let layers = Layers::of(&tree, &flat(&tree), &Params { width_px: 900, ..Params::default() });
        let (sin, cos) = espalier_geom::math::sin_cos(turn_deg.to_radians());
        let (first, second) = (DVec2::X, DVec2::new(cos, sin));
        let mm_per_px = (layers.plane(1, 0) - layers.plane(0, 0)).x;
        let mut n_joined = 0;
        for (x, y) in layers.pixels() {
            let point = layers.plane(x, y);
            let (height, covered) = (layers.at("height.mm", x, y), layers.at("A", x, y));
            let along = [-point.dot(first), point.dot(second)];
            // Beside both arms both count, beyond both only the ball at the joint.
            let level = if along[0] > 0.0 && along[1] > 0.0 && along[0].max(along[1]) < 28.0 {
                let asides = [first, second].map(|axis| point - point.dot(axis) * axis);
                let bare = asides.map(|aside| 16.0 - aside.length_squared());
                let level = joined(asides);
                n_joined += usize::from(level > bare[0].max(bare[1]) + 0.01);
                level
            } else if along[0] < 0.0 && along[1] < 0.0 {
                16.0 - point.length_squared()
            } else {
                continue;
            };
            let outside = (16.0 - level).max(0.0).sqrt() - 4.0;
            if level > 1.0 {
                assert!(
                    (height * height - level).abs() < 0.02,
                    "{turn_deg} {point}: {height} {}",
                    level.sqrt()
                );
            }
            assert!(
                (covered - (0.5 - outside / mm_per_px).clamp(0.0, 1.0)).abs() < 0.06,
                "{turn_deg} {point}: {covered} {outside}"
            );
        }
        assert!(n_joined > 60, "{turn_deg} {n_joined}");
    }
}

#[test]
fn no_hair_stands_beside_a_thin_branch_on_a_thick_one() {
    let tree = Tree::new(&[
        node(-30.0, 0.0, 0.0, 8.0, None),
        node(0.0, 0.0, 0.0, 8.0, Some(0)),
        node(30.0, 0.0, 0.0, 8.0, Some(1)),
        node(6.0, 0.0, 24.0, 1.5, Some(1)),
    ])
    .expect("a tree");
    let layers = Layers::of(&tree, &flat(&tree), &Params { width_px: 1200, ..Params::default() });
    // What is covered is next to something that is covered on both sides, or above or below: nothing is a pixel wide.
    for (x, y) in layers.pixels() {
        if x == 0 || y == 0 || x + 1 == layers.width || y + 1 == layers.height || layers.at("A", x, y) < 0.6 {
            continue;
        }
        let is_in = |x: usize, y: usize| layers.at("A", x, y) > 0.05;
        let n_sides = [is_in(x - 1, y) || is_in(x + 1, y), is_in(x, y - 1) || is_in(x, y + 1)];
        let n_around = [
            (x - 1, y),
            (x + 1, y),
            (x, y - 1),
            (x, y + 1),
            (x - 1, y - 1),
            (x + 1, y - 1),
            (x - 1, y + 1),
            (x + 1, y + 1),
        ]
        .into_iter()
        .filter(|&(x, y)| is_in(x, y))
        .count();
        assert!(n_sides == [true; 2] && n_around >= 4, "{}: {n_around}", layers.plane(x, y));
    }
}

#[test]
fn nodes_of_a_straight_tube_do_not_show() {
    // Steps of all lengths, from far less than the radius to far more.
    let mut stream = espalier_geom::random::Stream::new(3, espalier_geom::random::Purpose::Test, 0, 0);
    let mut nodes = vec![node(0.0, 0.0, 0.0, 3.0, None)];
    while nodes[nodes.len() - 1].position_mm.x < 40.0 {
        let share = stream.uniform(0.02, 1.0);
        let x = nodes[nodes.len() - 1].position_mm.x + share * share * share * 12.0;
        nodes.push(node(x, 0.0, 0.0, 3.0, Some(nodes.len() - 1)));
    }
    let tree = Tree::new(&nodes).expect("a tree");
    let layers = Layers::of(&tree, &flat(&tree), &Params { width_px: 900, ..Params::default() });
    for (x, y) in layers.pixels() {
        let point = layers.plane(x, y);
        if (0.0..40.0).contains(&point.x) && point.y.abs() < 2.9 {
            let height = (9.0 - point.y * point.y).sqrt();
            assert!((layers.at("height.mm", x, y) - height).abs() < 0.01, "{point}");
            assert_eq!(layers.at("A", x, y), 1.0);
        }
    }
}

#[test]
fn a_smooth_curve_keeps_its_width_and_nothing_jumps() {
    // Half a circle of radius 9 in steps of 3 to 12 degrees, a tube of radius 3.
    for step_deg in [3.0_f64, 6.0, 12.0] {
        let n_steps = (180.0 / step_deg) as usize;
        let at = |i: usize| {
            let (sin, cos) = espalier_geom::math::sin_cos((step_deg * i as f64).to_radians());
            node(9.0 * cos, 0.0, 9.0 * sin, 3.0, i.checked_sub(1))
        };
        let tree = Tree::new(&(0..=n_steps).map(at).collect::<Vec<_>>()).expect("a tree");
        let layers = Layers::of(&tree, &flat(&tree), &Params { width_px: 700, ..Params::default() });
        let mm_per_px = (layers.plane(1, 0) - layers.plane(0, 0)).x;
        // A polygon stands inside of its circle by this much.
        let flat_mm = 9.0 * (1.0 - espalier_geom::math::cos(0.5 * step_deg.to_radians()));
        for (x, y) in layers.pixels() {
            let point = layers.plane(x, y);
            let aside = point.length() - 9.0;
            if point.y > 0.5 && aside.abs() < 2.6 {
                let off = 2.0 * (flat_mm + mm_per_px) * 2.6 / (9.0_f64 - 2.6 * 2.6).sqrt();
                let height = (9.0 - aside * aside).sqrt();
                let seen = layers.at("height.mm", x, y);
                assert!((seen - height).abs() < off, "{step_deg} {point}: {seen} {height}");
            }
        }
    }
    // Two turns with a short edge between them: where either is the highest, the surface goes on without a step.
    let tree = Tree::new(&[
        node(-20.0, 0.0, 0.0, 4.0, None),
        node(0.0, 0.0, 0.0, 4.0, Some(0)),
        node(1.2, 0.0, 0.4, 4.0, Some(1)),
        node(14.0, 0.0, 12.0, 4.0, Some(2)),
    ])
    .expect("a tree");
    let layers = Layers::of(&tree, &flat(&tree), &Params { width_px: 1200, ..Params::default() });
    let mut most: f64 = 0.0;
    for (x, y) in layers.pixels() {
        let point = layers.plane(x, y);
        if point.length() > 6.0 {
            continue;
        }
        let at = |x: usize, y: usize| layers.at("height.mm", x, y);
        let least = [at(x - 1, y), at(x, y), at(x + 1, y), at(x, y - 1), at(x, y + 1)];
        if least.into_iter().all(|height| height > 2.2) {
            let bent = (at(x - 1, y) - 2.0 * at(x, y) + at(x + 1, y)).abs();
            let bent = bent.max((at(x, y - 1) - 2.0 * at(x, y) + at(x, y + 1)).abs());
            most = most.max(bent);
        }
    }
    assert!(most < 0.012, "{most}");
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
