//! The page: it asks for nothing, says what is not there, lets no text act, and stays small.

#![allow(clippy::expect_used, reason = "a test says what it expects")]

use espalier_model::{
    Certificate, ComparedLayout, Comparison, Embedding, Energy, Grid, Ledger, LedgerEntry, LedgerKind,
    Losses, Mask, MethodRow, Node, Pose, TargetKind, Targets, Termination, Tree, View, ViewHierarchy, Widths,
};
use espalier_report::{
    Coloring, Facts, InputFile, InputKind, Params, Rows, Setting, Slices, StageFacts, report,
};
use glam::{DVec2, DVec3};

/// What a hostile hand would write.
const EVIL: &str = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'&";

/// A tree of `n_nodes` in which every `every`-th node begins a branch from a node before it.
fn tree(n_nodes: usize, every: usize) -> Tree {
    let mut state = 7_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    let mut nodes = vec![Node { position_mm: DVec3::ZERO, radius_mm: 3.0, parent: None, kind: 0 }];
    for index in 1..n_nodes {
        let parent = if index % every == 0 { next() % index } else { index - 1 };
        let step = DVec3::new((next() % 200) as f64 - 80.0, (next() % 200) as f64 - 99.0, 50.0) / 100.0;
        let above = nodes[parent];
        nodes.push(Node {
            position_mm: above.position_mm + step,
            radius_mm: (above.radius_mm * 0.999).max(0.05),
            parent: Some(parent),
            kind: 0,
        });
    }
    Tree::new(&nodes).expect("a tree")
}

fn row(method: &str, energy: f64) -> MethodRow {
    MethodRow {
        method: method.to_owned(),
        crossings: 0,
        overlaps: 3,
        energy: Energy { length: energy, ..Energy::default() },
        losses: Losses { length_loss_mean: 0.01, spearman: 0.9, ..Losses::default() },
        evaluations: 1,
        targets: TargetKind::Intrinsic,
    }
}

fn flat(tree: &Tree, angle: f64) -> Vec<DVec2> {
    let (sin, cos) = espalier_geom::math::sin_cos(angle);
    let at = |p: DVec3| DVec2::new(cos * p.x - sin * p.z, sin * p.x + cos * p.z);
    tree.nodes().iter().map(|node| at(node.position_mm)).collect()
}

/// A run as values, to be shown.
struct Run {
    tree: Tree,
    views: ViewHierarchy,
    embedding: Embedding,
    comparison: Comparison,
    ledger: Ledger,
    mask: Mask,
    branches: String,
}

impl Run {
    fn of(tree: Tree, label: &str) -> Self {
        let n_nodes = tree.n_nodes();
        let view = View {
            towards_camera: DVec3::Y,
            up: DVec3::Z,
            center_mm: DVec3::ZERO,
            radius_mm: 1.0,
            loss: 0.0,
        };
        let methods = vec![row("solver", 1.0), row("marino", 2.0), row("radial", 3.0)];
        let layouts = methods.iter().zip(0..).map(|(row, turn)| ComparedLayout {
            row: row.clone(),
            quantum_mm: 1e-4,
            positions_mm: flat(&tree, f64::from(turn)),
            trace: Vec::new(),
        });
        let comparison = Comparison {
            tree: tree.digest(),
            targets: String::new(),
            seed: 1,
            chosen: 0,
            layouts: layouts.collect(),
        };
        let embedding = Embedding {
            tree: tree.digest(),
            method: "solver".to_owned(),
            seed: 1,
            positions_mm: flat(&tree, 0.0),
            quantum_mm: 1e-4,
            targets: Targets {
                kind: TargetKind::Intrinsic,
                angle_rad: vec![3.0; n_nodes],
                length_mm: (0..n_nodes).map(|node| tree.edge_length_mm(node)).collect(),
                heading_rad: vec![0.0; n_nodes],
                confidence: vec![1.0; n_nodes],
            },
            length_ratio: vec![0.0; n_nodes],
            angle_ratio: vec![0.0; n_nodes],
            energy: Energy { length: 1.0, ..Energy::default() },
            losses: Losses::default(),
            certificate: Certificate::default(),
            widths: Widths { is_complete: true, radius_scale: 1.0, ..Widths::default() },
            pose: Pose::default(),
            termination: Termination::Converged,
            trace: Vec::new(),
            methods,
            edits: Vec::new(),
        };
        let entry = |kind| LedgerEntry {
            kind,
            position_mm: DVec3::ZERO,
            radius_mm: 1.0,
            length_mm: 2.0,
            reason: format!("because {label}"),
        };
        let ledger = Ledger(vec![entry(LedgerKind::LoopCut), entry(LedgerKind::RootChosen)]);
        let grid = Grid::axis_aligned([12, 10, 14], DVec3::ONE, DVec3::splat(-5.0)).expect("a grid");
        let mask = Mask::from_fn(grid, |[x, y, _]| (4..7).contains(&x) && (3..6).contains(&y));
        let branches = tree.branches();
        let mut table =
            String::from("branch\tparent\tchildren\tgeneration\tlength_mm\tradius_mean_mm\tlabel_name\n");
        for (index, branch) in branches.list().iter().enumerate() {
            let parent = branch.parent.map_or("n/a".to_owned(), |parent| parent.to_string());
            table += &format!("{index}\t{parent}\t\t{}\t1.5\t0.75\t{label}\n", branch.generation);
        }
        let views = ViewHierarchy {
            tree: tree.digest(),
            global: view,
            subtrees: Vec::new(),
            chains: Vec::new(),
            forks: vec![None; n_nodes],
        };
        Self { tree, views, embedding, comparison, ledger, mask, branches: table }
    }

    fn whole(&self) -> Facts<'_> {
        let colors = vec![[1, 2, 3], [4, 5, 6], [7, 8, 9]];
        let coloring = |key, name: &str| Coloring {
            key,
            name: name.to_owned(),
            caption: "mm".to_owned(),
            light: colors.clone(),
            dark: colors.clone(),
            bins: (0..self.tree.n_nodes()).map(|node| (node / 5 % 3) as u8).collect(),
            ticks: vec![(0.5, "1".to_owned())],
        };
        Facts {
            slices: Some(Slices {
                range: [-1000.0, 400.0],
                window: [-900.0, 100.0],
                png: [vec![1], vec![2], vec![3]],
            }),
            mask: Some(&self.mask),
            ledger: Some(&self.ledger),
            comparison: Some(&self.comparison),
            branches: Some(Rows::parse(&self.branches)),
            generations: Some(Rows::parse(
                "generation\tradius_mean_mm\tradius_sd_mm\n0\t1\t0.5\n1\t0.5\tn/a\n",
            )),
            stenoses: Some(Rows::parse("candidate\tbranch\n0\t0\n")),
            dictionary: Some(Rows::parse("table\tcolumn\tunit\tmeaning\na.tsv\tb\tmm\tc\n")),
            space_png: Some(vec![1; 24]),
            colorings: vec![coloring("radius", "radius"), coloring("angle-loss", "angle loss")],
            input_files: vec![InputFile {
                role: "input".to_owned(),
                n_bytes: "17".to_owned(),
                sha256: "abc".to_owned(),
            }],
            stages: vec![StageFacts {
                stage: "volume".to_owned(),
                counts: vec![("foreground_voxels".to_owned(), 126.0)],
                warnings: vec![("W-X".to_owned(), "careful".to_owned())],
            }],
            settings: vec![Setting {
                key: "tree.root".to_owned(),
                value: "\"superior\"".to_owned(),
                default: Some("\"auto\"".to_owned()),
            }],
            ..self.bare()
        }
    }

    /// No more than a page needs.
    fn bare(&self) -> Facts<'_> {
        Facts {
            name: Some("a run"),
            program: "espalier 0",
            seed: 1,
            input_kind: InputKind::Volume,
            input_files: Vec::new(),
            slices: None,
            mask: None,
            tree: &self.tree,
            views: &self.views,
            ledger: None,
            embedding: &self.embedding,
            comparison: None,
            branches: None,
            generations: None,
            stenoses: None,
            dictionary: None,
            space_png: None,
            colorings: Vec::new(),
            stages: Vec::new(),
            settings: Vec::new(),
            results_sha256: "digest".to_owned(),
        }
    }
}

fn page(facts: &Facts<'_>) -> String {
    report(facts, &Params::default()).expect("a page").html
}

const SECTIONS: [&str; 11] = [
    "verdict",
    "input",
    "tree",
    "map",
    "methods-compared",
    "worst",
    "branches",
    "generations",
    "profile",
    "methods",
    "provenance",
];

/// The attributes of this name in a page.
fn attributes<'a>(html: &'a str, name: &str) -> Vec<&'a str> {
    let opening = format!(" {name}=\"");
    html.split(&opening).skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

fn assert_asks_for_nothing(html: &str) {
    for href in attributes(html, "href") {
        assert!(href.starts_with('#') || href.starts_with("data:image/png;base64,"), "{href:.60}");
    }
    for forbidden in [" src=", "url(", "@import", "://", "<link", "<iframe", "<object", "<form", "srcset"] {
        assert!(!html.contains(forbidden), "{forbidden}");
    }
}

#[test]
fn a_whole_page_has_every_section_and_asks_for_nothing() {
    let run = Run::of(tree(400, 9), "left lobe");
    let html = page(&run.whole());
    for section in SECTIONS {
        assert!(html.contains(&format!("<section id=\"{section}\"")), "{section}");
        assert!(html.contains(&format!("href=\"#{section}\"")), "{section} in the list");
    }
    assert_asks_for_nothing(&html);
    assert!(html.contains("For research use only"));
    assert_eq!(attributes(&html, "id").len(), {
        let mut ids = attributes(&html, "id");
        ids.sort_unstable();
        ids.dedup();
        ids.len()
    });
    assert!(!html.contains("class=\"absent\""), "nothing is missing");
}

#[test]
fn what_is_missing_is_said() {
    let run = Run::of(tree(60, 9), "x");
    let html = page(&run.bare());
    for section in SECTIONS {
        assert!(html.contains(&format!("<section id=\"{section}\"")), "{section}");
    }
    for said in [
        "mask of this run is not at hand",
        "no topology ledger",
        "no table of branches",
        "no tables of branches",
    ] {
        assert!(html.contains(said), "{said}");
    }
    let traced = page(&Facts { input_kind: InputKind::Tree, ..run.bare() });
    assert!(traced.contains("traced tree: there is no scan"));
    assert_asks_for_nothing(&html);
}

#[test]
fn the_methods_say_how_the_mask_was_chosen() {
    let run = Run::of(tree(60, 9), "x");
    let written = |counts: &[(&str, f64)], settings: &[(&str, &str)]| {
        let mut facts = run.whole();
        facts.stages[0].counts.extend(counts.iter().map(|&(name, value)| (name.to_owned(), value)));
        facts.settings.extend(settings.iter().map(|&(key, value)| Setting {
            key: key.to_owned(),
            value: value.to_owned(),
            default: None,
        }));
        report(&facts, &Params::default()).expect("a page").methods
    };
    let cases = [
        (written(&[], &[]), "The mask was taken from the input."),
        (written(&[], &[("volume.label", "3")]), "The mask is one or more labels of a label map."),
        (
            written(&[], &[("volume.lower", "150"), ("volume.upper", "not set")]),
            "all voxels with values from 150 on.",
        ),
        (written(&[("band_lower", 150.0)], &[]), "all voxels with values from 150 on."),
        (
            written(&[("band_upper", -863.0), ("seed_candidates", 3.0), ("stable_threshold", -863.0)], &[]),
            "with values up to -863 [@Adams1994]. The seed was found in the trachea. The threshold is the last before",
        ),
        (
            written(
                &[("band_upper", -871.0), ("edges_threshold", -935.0), ("edges_voxels", 40.0)],
                &[("volume.seed_voxel", "[1, 2, 3]")],
            ),
            "Up to -935 it also grew over edges and corners, by 40 voxels.",
        ),
        (
            written(
                &[
                    ("band_lower", 156.0),
                    ("half_maximum", 156.0),
                    ("value_inside", 210.0),
                    ("value_outside", 102.0),
                    ("stable_threshold", 129.0),
                ],
                &[("volume.seed_voxel", "[1, 2, 3]")],
            ),
            "half-way between the medians of the values inside, 210, and outside, 102 [@Ridler1978].",
        ),
        (
            written(&[("band_lower", 1.0), ("band_upper", 2.0)], &[("volume.seed_voxel", "[1, 2, 3]")]),
            "grown from a seed over 6-connected voxels with values from 1 to 2 [@Adams1994].",
        ),
        (
            written(
                &[],
                &[
                    ("render.style", "\"volume\""),
                    ("render.volume.slab_mm", "3.0"),
                    ("render.volume.slab", "\"mip\""),
                ],
            ),
            "the largest value over a slab of 3 mm: a curved planar reformation [@Kanitsar2002]",
        ),
    ];
    for (text, expected) in cases {
        assert!(text.contains(expected), "{expected}\n{text}");
        assert!(!text.contains(".. "), "{text}");
    }
}

#[test]
fn a_single_node_and_a_single_branch_have_a_page() {
    for n_nodes in [1, 2, 5] {
        let run = Run::of(tree(n_nodes, 1000), "x");
        assert_asks_for_nothing(&page(&run.whole()));
        assert_asks_for_nothing(&page(&run.bare()));
    }
}

#[test]
fn texts_are_inert() {
    let run = Run::of(tree(80, 9), EVIL);
    let mut facts = run.whole();
    facts.name = Some(EVIL);
    facts.settings.push(Setting {
        key: EVIL.to_owned(),
        value: EVIL.to_owned(),
        default: Some(EVIL.to_owned()),
    });
    facts.stages[0].warnings.push((EVIL.to_owned(), EVIL.to_owned()));
    facts.stages[0].counts.push((EVIL.to_owned(), 1.0));
    facts.input_files[0].role = EVIL.to_owned();
    facts.dictionary = Some(Rows::parse(&format!("table\tcolumn\n{EVIL}\t{EVIL}\n")));
    facts.colorings[0].caption = EVIL.to_owned();
    facts.colorings[0].ticks[0].1 = EVIL.to_owned();
    let html = page(&facts);
    let harmless = Run::of(tree(80, 9), "x");
    let plain = page(&harmless.whole());
    for tag in ["<script", "</script", "<img", "onerror=alert(2)>"] {
        assert_eq!(html.matches(tag).count(), plain.matches(tag).count(), "{tag}");
    }
    let titled = Params { title: Some(EVIL.to_owned()), ..Params::default() };
    let html = report(&facts, &titled).expect("a page").html;
    assert!(html.contains("<h1>&lt;/script&gt;"));
    assert!(!html.contains("<img"));
}

#[test]
fn a_tree_of_fifty_thousand_nodes_stays_small() {
    // Long branches, and as many short ones as there can be.
    for every in [40, 2] {
        let run = Run::of(tree(50_000, every), "upper lobe");
        let mut facts = run.whole();
        let mut comparison = run.comparison.clone();
        let more = comparison.layouts.clone();
        comparison.layouts.extend(more);
        facts.comparison = Some(&comparison);
        let html = page(&facts);
        assert!(html.len() < 5_000_000, "every {every}: {} bytes", html.len());
        assert!(html.contains("branches.tsv has all"));
        assert_asks_for_nothing(&html);
    }
}

#[test]
fn the_same_facts_give_the_same_bytes() {
    let run = Run::of(tree(300, 7), "x");
    let [a, b] = [(), ()].map(|()| report(&run.whole(), &Params::default()).expect("a page"));
    assert_eq!(a, b);
}

#[test]
fn methods_cite_what_ran() {
    let run = Run::of(tree(100, 9), "x");
    let mut facts = run.whole();
    facts.stages.push(StageFacts { stage: "skeleton".to_owned(), ..StageFacts::default() });
    let made = report(&facts, &Params::default()).expect("a page");
    assert!(made.methods.contains("[@Lee94]") && made.methods.contains("[@Marino2015]"), "{}", made.methods);
    assert!(made.references.contains("@article{Lee94,"), "{}", made.references);
    for key in made.references.lines().filter_map(|line| line.strip_prefix("@article{")) {
        assert!(made.methods.contains(key.trim_end_matches(',')), "{key}");
    }
    let traced =
        report(&Facts { input_kind: InputKind::Tree, ..run.bare() }, &Params::default()).expect("a page");
    assert!(!traced.methods.contains("Lee94"), "nothing was thinned");
}

#[test]
fn facts_of_another_tree_are_refused() {
    let [run, other] = [Run::of(tree(30, 9), "x"), Run::of(tree(31, 9), "x")];
    let facts = Facts { embedding: &other.embedding, ..run.bare() };
    assert!(report(&facts, &Params::default()).is_err());
}
