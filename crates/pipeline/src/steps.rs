//! What each stage does with its hand-over data: take, call, hand on, say in one line.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use espalier_embed::PoseMode;
use espalier_model::table::{Column, Table, fixed};
use espalier_model::{
    Comparison, Embedding, Grid, GridError, InscribedSpheres, Ledger, LedgerKind, Mask, MethodRow, Report,
    Termination, TracePoint, Tree, ViewHierarchy, nifti_out, swc,
};
use espalier_render::{ColorBy, SpaceSubject, Style};

use crate::artifacts::{Artifacts, Lookup, SOURCE_KEY, SOURCE_SCAN, SOURCE_TRACING};
use crate::compare::figure;
use crate::config::{Config, Source};
use crate::dictionary;
use crate::error::Error;
use crate::estimate::{self, Sizes};
use crate::event::Event;
use crate::folder::RunFolder;
use crate::labels;
use crate::methods::MethodWatch;
use crate::page;
use crate::phantom;
use crate::provenance::PartCost;
use crate::run::boxed;
use crate::scan_of_map;
use crate::space;
use crate::stage::{Artifact, Stage};
use crate::tree_outputs::{self, Made};

/// What a stage came to: its files, not yet written.
pub(crate) struct Outcome {
    pub(crate) files: Vec<(String, Vec<u8>)>,
    pub(crate) report: Report,
    pub(crate) line: String,
}

/// A stage about to be done.
pub(crate) struct Step<'a> {
    pub(crate) stage: Stage,
    pub(crate) config: &'a Config,
    pub(crate) source: &'a Source,
    pub(crate) artifacts: &'a mut Artifacts,
    pub(crate) events: &'a (dyn Fn(Event) + Sync),
    pub(crate) folder: &'a RunFolder,
    /// What parts of the stage have cost, filled in while it is done.
    pub(crate) parts: Vec<PartCost>,
}

/// Does a stage.
pub(crate) fn perform(step: &mut Step<'_>) -> Result<Outcome, Error> {
    match step.stage {
        Stage::Phantom => phantom(step),
        Stage::Volume => volume(step),
        Stage::Skeleton => skeleton(step),
        Stage::Radius => radius(step),
        Stage::Tree => tree(step),
        Stage::Views => views(step),
        Stage::Embed => embed(step),
        Stage::Render => render(step),
        Stage::Report => page::report(step),
    }
}

fn phantom(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let (kind, scanned) = match *step.source {
        Source::PhantomScan(kind) => (kind, true),
        Source::PhantomTree(kind) => (kind, false),
        Source::Volume(_) | Source::Tree(_) => {
            let available = "volume to render".to_owned();
            return Err(Error::NoSuchStage { flag: "from", stage: Stage::Phantom, available });
        }
    };
    let made = phantom::make(kind, step.config, scanned)?;
    let mut report = Report::default();
    report.count_usize("nodes", made.tree.n_nodes());
    report.count_usize("tips", made.tree.n_tips());
    let mut line = format!("{}: {} nodes, {} tips", kind.name(), made.tree.n_nodes(), made.tree.n_tips());
    if let Some(scan) = &made.scan {
        report.count_usize("voxels", scan.grid().n_voxels());
        line = format!("{line}, {}", describe_grid(scan.grid()));
    }
    let files = made.files()?.into_iter().map(|(name, bytes)| step.beside(name, bytes)).collect();
    Ok(Outcome { files, report, line })
}

fn volume(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let params = step.config.volume.clone();
    let segmented = step.take(|artifacts, lookup| artifacts.segmented(lookup, &params))?;
    let mask = on_stored_grid(segmented.mask).map_err(|error| step.failed(error))?;
    let n_foreground = mask.n_foreground();
    let mut line = format!(
        "{n_foreground} voxels, {:.1} ml of {}",
        n_foreground as f64 * mask.grid().voxel_volume_mm3() / 1000.0,
        describe_grid(mask.grid())
    );
    if mask.grid().orientation() != segmented.stored_orientation {
        line = format!("{line}, stored as {}", segmented.stored_orientation);
    }
    let dropped = segmented.ledger.to_tsv();
    step.artifacts.dropped = Some(step.read_back(&dropped, Ledger::from_tsv)?);
    let n_dropped = segmented.report.get("components_dropped").unwrap_or(0.0);
    if n_dropped > 0.0 {
        line = format!("{line}; {n_dropped} components dropped");
    }
    if let Some((stable, leaking)) = segmented.growth.as_ref().and_then(espalier_volume::Growth::leak) {
        line = format!("{line}; it leaks at {}, {} is the last before", leaking.threshold, stable.threshold);
    }
    let mut report = segmented.report;
    let slices = page::slices(step, &mask, &mut report)?;
    if let Some(left) = report.get("tunnels_left") {
        line = format!("{line}; {} tunnels, {left} left", report.get("tunnels").unwrap_or(left));
    }
    let mut files = vec![
        step.place(Artifact::Mask, nifti_out::mask(&mask).map_err(|error| step.failed(error))?),
        step.beside("dropped.tsv", dropped.into_bytes()),
    ];
    if let Some(growth) = &segmented.growth {
        files.push(step.beside("growth.tsv", growth.to_tsv().into_bytes()));
    }
    if !segmented.seeds.is_empty() {
        files.push(step.beside("seeds.tsv", espalier_volume::seeds_to_tsv(&segmented.seeds).into_bytes()));
    }
    files.extend(slices);
    step.artifacts.mask = Some(Arc::new(mask));
    Ok(Outcome { files, report, line })
}

fn skeleton(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let mask = step.take(Artifacts::mask)?;
    step.must_fit(&Sizes::of_mask(&mask))?;
    let made =
        espalier_skeleton::skeletonize(&mask, &step.config.skeleton).map_err(|error| step.failed(error))?;
    let line = format!("{} voxels", made.skeleton.voxels().len());
    let bytes = nifti_out::skeleton(&made.skeleton).map_err(|error| step.failed(error))?;
    step.artifacts.skeleton = Some(Arc::new(made.skeleton));
    Ok(Outcome { files: vec![step.place(Artifact::Skeleton, bytes)], report: made.report, line })
}

fn radius(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let mask = step.take(Artifacts::mask)?;
    let skeleton = step.take(Artifacts::skeleton)?;
    step.must_fit(&Sizes::of_mask(&mask))?;
    let measured = espalier_radius::inscribed_spheres(&mask, &skeleton, &step.config.radius)
        .map_err(|error| step.failed(error))?;
    let spheres = measured.spheres;
    let radii = || spheres.0.iter().map(|sphere| sphere.radius_mm);
    let line =
        format!("{:.2} to {:.2} mm", radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
    let single: Vec<f32> = radii().map(|radius_mm| radius_mm as f32).collect();
    let radius_image = nifti_out::skeleton_scalars(&skeleton, &single).map_err(|error| step.failed(error))?;
    let table = spheres.to_tsv();
    step.artifacts.spheres = Some(Arc::new(step.read_back(&table, InscribedSpheres::from_tsv)?));
    let mut files =
        vec![step.beside("radius.nii.gz", radius_image), step.place(Artifact::Spheres, table.into_bytes())];
    if step.config.radius.field {
        files.push(step.beside("distance.nii.gz", distance_image(step, &mask)?));
    }
    Ok(Outcome { files, report: measured.report, line })
}

/// The distance of every voxel of the mask to the background, in mm.
fn distance_image(step: &Step<'_>, mask: &Mask) -> Result<Vec<u8>, Error> {
    let limit = step.artifacts.read_options.max_bytes;
    let field = espalier_radius::distance_field_within(mask, limit).map_err(|error| step.failed(error))?;
    let distance_mm = |voxel: [usize; 3]| field.distance_mm(voxel.map(|c| c as i64)) as f32;
    nifti_out::mask_scalars(mask, distance_mm).map_err(|error| step.failed(error))
}

fn tree(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let params = &step.config.tree;
    let mut ledger = Ledger::default();
    let mut scan = None;
    let (built, mut report) = if step.is_traced() {
        let (traced, report) = step.take(Artifacts::traced)?;
        step.must_fit(&Sizes { nodes: traced.nodes.len() as u64, ..Sizes::default() })?;
        (espalier_tree::from_traced(&traced, params).map_err(|error| step.failed(error))?, report)
    } else {
        let mask = step.take(Artifacts::mask)?;
        step.must_fit(&Sizes::of_mask(&mask))?;
        let skeleton = step.take(Artifacts::skeleton)?;
        let spheres = step.take(Artifacts::spheres)?;
        ledger = step.take(Artifacts::dropped)?;
        let built =
            espalier_tree::build(&mask, &skeleton, &spheres, params).map_err(|error| step.failed(error))?;
        scan = Some((mask, spheres));
        (built, Report::default())
    };
    report.extend(built.report);
    if step.artifacts.is_unit_guessed {
        warn_of_unit(&built.tree, &mut report);
    }
    let is_of_scan = !step.is_traced();
    let source = if is_of_scan { SOURCE_SCAN } else { SOURCE_TRACING };
    let text = swc::write(&built.tree, &[(SOURCE_KEY, source)]);
    step.artifacts.is_of_scan = is_of_scan;
    let tree = step.read_back(&text, swc::read_tree)?;
    let line = format!(
        "{} nodes, {} branches, {} tips, {}{}",
        tree.n_nodes(),
        tree.branches().list().len(),
        tree.n_tips(),
        readable_length(tree.length_mm()),
        ledger_phrase(&built.ledger)
    );
    ledger.0.extend(built.ledger.0);
    let labels = step.take(|artifacts, lookup| artifacts.label_map(lookup, params.label_reach_mm))?;
    let scan = scan.as_ref().map(|(mask, spheres)| (&**mask, &**spheres));
    let made = Made { tree: &tree, scan, labels, params };
    let mut files = tree_outputs::files(&made, &mut report, |error| step.failed(error))?;
    files.extend([
        step.place(Artifact::Tree, text.into_bytes()),
        ("topology.tsv".to_owned(), ledger.to_tsv().into_bytes()),
        ("dictionary.tsv".to_owned(), dictionary::text().into_bytes()),
    ]);
    step.artifacts.tree = Some(Arc::new(tree));
    Ok(Outcome { files, report, line })
}

/// Warns of a traced tree too large for a neuron where nobody has said what its unit is.
fn warn_of_unit(tree: &Tree, report: &mut Report) {
    if let Some(found) = too_large_for_a_neuron(tree) {
        let way_out = "if it is in voxels, nm or mm, set input.unit or input.scale";
        report.warn(
            "W-SWC-UNIT",
            format!("taken as µm, the tree is {found}, more than neurons are: {way_out}"),
        );
    }
}

/// How a tree is larger than neurons are; none if it is not.
pub(crate) fn too_large_for_a_neuron(tree: &Tree) -> Option<String> {
    /// Few neurons spread over more than some centimetres.
    const LARGEST_EXTENT_MM: f64 = 100.0;
    /// Somata apart, neurites of mammals and flies stay below 0.01 mm; a tracing in voxels of 8 nm has 0.04.
    const LARGEST_MEAN_RADIUS_MM: f64 = 0.02;
    let (extent_mm, radius_mm) = (2.0 * tree.extent_mm(), tree.mean_radius_mm());
    if extent_mm > LARGEST_EXTENT_MM {
        Some(format!("{extent_mm:.0} mm across"))
    } else {
        (radius_mm > LARGEST_MEAN_RADIUS_MM).then(|| format!("{:.0} µm thick on average", 2000.0 * radius_mm))
    }
}

fn views(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let tree = step.take(Artifacts::tree)?;
    step.must_fit(&Sizes::default().and_tree(&tree))?;
    let found = espalier_views::find_views(&tree, &step.config.views, step.config.seed)
        .map_err(|error| step.failed(error))?;
    let json = found.hierarchy.to_json();
    let hierarchy = step.read_back(&json, |text| ViewHierarchy::from_json(text, &tree))?;
    let line = format!(
        "global loss {:.3}, {} subtree views, {} planes",
        hierarchy.global.loss,
        hierarchy.subtrees.len(),
        hierarchy.chains.len() + hierarchy.forks.iter().flatten().count()
    );
    step.artifacts.views = Some(Arc::new(hierarchy));
    let files = vec![step.place(Artifact::Views, json.into_bytes())];
    Ok(Outcome { files, report: found.report, line })
}

fn embed(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let tree = step.take(Artifacts::tree)?;
    step.must_fit(&Sizes::default().and_tree(&tree))?;
    let views = step.take(Artifacts::views)?;
    let mut params = step.config.embed.clone();
    if params.pose == PoseMode::Auto {
        params.pose = if step.artifacts.is_of_scan { PoseMode::View } else { PoseMode::RootOnTop };
    }
    if let Some((towards_camera, up)) = step.artifacts.marino_axes()? {
        (params.marino.towards_camera, params.marino.up) = (towards_camera.to_array(), up.to_array());
    }
    let edits = step.artifacts.edits(&tree)?;
    let (seed, watch) = (step.config.seed, MethodWatch::new(step.stage, step.events));
    let hear = |event| watch.hear(event);
    let embedded = espalier_embed::embed_edited((&tree, &views), &edits, &params, seed, &hear)
        .map_err(|error| step.failed(error))?;
    step.parts = watch.into_costs();
    let json = embedded.embedding.to_json();
    let embedding = step.read_back(&json, |text| Embedding::from_json(text, &tree))?;
    let compared_json = embedded.comparison.to_json();
    let comparison = step.read_back(&compared_json, |text| Comparison::from_json(text, &tree))?;
    let line = embedding_phrase(&embedding);
    let files = vec![
        ("nodes.tsv".to_owned(), embedding.nodes_tsv(&tree).into_bytes()),
        ("compare.tsv".to_owned(), MethodRow::to_tsv(&embedding.methods).into_bytes()),
        ("dictionary.tsv".to_owned(), dictionary::text().into_bytes()),
        step.beside("convergence.tsv", convergence_tsv(&embedded.comparison).into_bytes()),
        step.place(Artifact::Embedding, json.into_bytes()),
        step.place(Artifact::Comparison, compared_json.into_bytes()),
    ];
    step.artifacts.comparison = Some(Arc::new(comparison));
    step.artifacts.embedding = Some(Arc::new(embedding));
    Ok(Outcome { files, report: embedded.report, line })
}

fn render(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let tree = step.take(Artifacts::tree)?;
    let views = step.take(Artifacts::views)?;
    let embedding = step.take(Artifacts::embedding)?;
    let comparison = step.take(Artifacts::comparison)?;
    let mut params = step.config.render.clone();
    let mask = if params.space && page::has_mask(step) { Some(step.take(Artifacts::mask)?) } else { None };
    let sizes = mask.as_deref().map(Sizes::of_mask).unwrap_or_default();
    step.must_fit(&sizes.and_tree(&tree).and_pictures(&params))?;
    params.title = params.title.or_else(|| step.config.own_name().map(str::to_owned));
    params.compass = figure::compass(params.compass, step.artifacts.is_of_scan);
    params.labels = labels::labels(step, &tree)?;
    let (made, report) = if params.style == Style::Volume {
        let (scan, report) = scan_of_map::of_tree(step, &tree, &params)?;
        (espalier_render::render_scan((&tree, &embedding, &views), &scan, &params), report)
    } else {
        (espalier_render::render(&tree, &embedding, &views, &params), Report::default())
    };
    let made = made.map_err(|error| step.failed(error))?;
    let mut report = Report { warnings: [report.warnings, made.report.warnings].concat(), ..made.report };
    let mut files = vec![
        ("planar.png".to_owned(), made.png),
        ("planar.svg".to_owned(), made.svg.into_bytes()),
        ("global-view.png".to_owned(), made.global_view_png),
    ];
    if let Some(pdf) = made.pdf {
        files.push(("planar.pdf".to_owned(), pdf));
    }
    if let Some(exr) = made.exr {
        files.push(("planar.exr".to_owned(), exr));
    }
    if params.space {
        let figure = space::figure(
            step,
            &SpaceSubject {
                tree: &tree,
                embedding: &embedding,
                view: &views.global,
                organ: None,
                turn_deg: made.turn_deg,
            },
            &params,
        )?;
        files.extend(figure);
    }
    if let Some(comparison) = comparison {
        let compass = params.compass;
        let subject =
            figure::Subject { name: None, tree: &tree, views: &views, comparison: &comparison, compass };
        files.extend(figure::draw(&[subject], &params).map_err(|error| step.failed(error))?);
        files.extend(figure::convergence(&comparison, &params).map_err(|error| step.failed(error))?);
    }
    let is_plain = || tree.edges().all(|(node, _)| tree.nodes()[node].kind == 0);
    if params.color_by == ColorBy::Label && params.labels.is_none() && is_plain() {
        let message =
            "no branch has a label to be coloured by: name a label map, such as lobes, in tree.labels";
        report.warn("W-RENDER-LABEL", message.to_owned());
    }
    let line = files.iter().map(|(file, _)| file.as_str()).collect::<Vec<_>>().join(", ");
    Ok(Outcome { files, report, line })
}

impl<'a> Step<'a> {
    /// An artifact, from memory or from its file.
    pub(crate) fn take<T>(
        &mut self,
        artifact: impl FnOnce(&mut Artifacts, Lookup<'a>) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let lookup = Lookup { folder: self.folder, stage: self.stage };
        artifact(self.artifacts, lookup)
    }

    /// Checks that the stage will not take more memory than allowed, before it takes any.
    fn must_fit(&self, sizes: &Sizes) -> Result<(), Error> {
        let (needed, limit) =
            (estimate::cost(self.stage, sizes).bytes, self.artifacts.read_options.max_bytes);
        if needed > limit { Err(Error::Memory { stage: self.stage, needed, limit }) } else { Ok(()) }
    }

    pub(crate) fn failed(&self, error: impl espalier_model::Diagnose + Send + Sync + 'static) -> Error {
        Error::stage(self.stage)(boxed(error))
    }

    pub(crate) fn is_traced(&self) -> bool {
        self.artifacts.is_traced(self.source)
    }

    /// An artifact's bytes at its place in the run folder.
    fn place(&self, artifact: Artifact, bytes: Vec<u8>) -> (String, Vec<u8>) {
        (artifact.file().to_owned(), bytes)
    }

    /// The bytes of another file in the stage's own folder.
    pub(crate) fn beside(&self, name: &str, bytes: Vec<u8>) -> (String, Vec<u8>) {
        (format!("{}/{name}", self.stage.folder()), bytes)
    }

    /// What a later reader will make of a text that is about to be written.
    fn read_back<T, E: espalier_model::Diagnose + Send + Sync + 'static>(
        &self,
        text: &str,
        parse: impl FnOnce(&str) -> Result<T, E>,
    ) -> Result<T, Error> {
        parse(text).map_err(|error| self.failed(error))
    }
}

/// Checks that a file can be opened and is a file, before anything is written.
pub(crate) fn check_readable(path: &Path, may_be_folder: bool) -> Result<(), Error> {
    let read = |source| Error::Read { path: path.to_owned(), source };
    if may_be_folder && path.is_dir() {
        return std::fs::read_dir(path).map(drop).map_err(read);
    }
    let file = File::open(path).map_err(read)?;
    if file.metadata().map_err(read)?.is_dir() {
        return Err(read(std::io::Error::from(std::io::ErrorKind::IsADirectory)));
    }
    Ok(())
}

/// The mask on its grid as a later stage would read it from the file.
fn on_stored_grid(mask: Mask) -> Result<Mask, GridError> {
    let grid = nifti_out::stored_grid(mask.grid())?;
    Ok(if grid == *mask.grid() { mask } else { Mask::new(grid, mask.into_bits()) })
}

fn describe_grid(grid: &Grid) -> String {
    let ([nx, ny, nz], spacing) = (grid.shape(), grid.spacing_mm());
    format!(
        "{nx}x{ny}x{nz} at {}x{}x{} mm {}",
        readable(spacing.x),
        readable(spacing.y),
        readable(spacing.z),
        grid.orientation()
    )
}

/// A number with at most four significant decimals and no trailing zeros.
fn readable(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn readable_length(length_mm: f64) -> String {
    if length_mm >= 1.0 { format!("{length_mm:.1} mm") } else { format!("{:.1} µm", length_mm * 1000.0) }
}

/// What the ledger holds, as a phrase: `; 3 loop_cut, 12 spur_pruned`.
fn ledger_phrase(ledger: &Ledger) -> String {
    let mut kinds: Vec<_> = ledger.0.iter().map(|entry| entry.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    // There is always a root.
    kinds.retain(|&kind| kind != LedgerKind::RootChosen);
    let phrases: Vec<String> = kinds
        .iter()
        .map(|kind| format!("{} {}", ledger.n_of(*kind), kind.name().replace('_', " ")))
        .collect();
    if phrases.is_empty() { String::new() } else { format!("; {}", phrases.join(", ")) }
}

fn embedding_phrase(embedding: &Embedding) -> String {
    let certificate = &embedding.certificate;
    let verdict = if certificate.holds() { "certified" } else { "not planar" };
    let is_optimal = embedding.termination == Termination::Optimal;
    let optimal = if is_optimal { ", proven optimal" } else { "" };
    // The published baselines; `compare.tsv` has all.
    let is_baseline = |row: &MethodRow| row.method.starts_with("marino") || row.method == "radial";
    let mut others: Vec<String> = embedding
        .methods
        .iter()
        .filter(|row| is_baseline(row) && row.method != embedding.method && row.crossings == 0)
        .map(|row| format!("{} {:.1}°", row.method, row.losses.angle3d_error_mean_deg))
        .collect();
    others.sort();
    let others = if others.is_empty() { String::new() } else { format!("  ({})", others.join(", ")) };
    let n_removed: usize = embedding.edits.iter().map(|record| record.crossings_removed).sum();
    let edits = match embedding.edits.len() {
        0 => String::new(),
        n_edits => format!("  edits {n_edits} ({n_removed} crossings removed)"),
    };
    format!(
        "crossings {} ({verdict}{optimal}){edits}  length loss {:.1} %  angle loss {:.1}°{others}",
        certificate.crossings,
        100.0 * embedding.losses.length_loss_mean,
        embedding.losses.angle3d_error_mean_deg,
    )
}

/// The columns of `convergence.tsv`.
pub(crate) const CONVERGENCE_COLUMNS: [Column; 7] = [
    Column::new("method", "n/a", "the method, as in compare.tsv"),
    Column::new("targets", "n/a", "the targets that it was scored against"),
    Column::new("phase", "n/a", "what had just been done"),
    Column::new("iteration", "1", "iteration of the method; 0 is the start"),
    Column::new(
        "evaluations",
        "1",
        "work so far: evaluations of a particle for a swarm, edges looked at for the solver",
    ),
    Column::new("energy", "1", "the best energy so far"),
    Column::new("crossings", "pairs", "the crossings of that best"),
];

/// The convergence curves of the methods that search: the best energy so far and its crossings.
fn convergence_tsv(comparison: &Comparison) -> String {
    let mut table = Table::with(&CONVERGENCE_COLUMNS);
    for layout in &comparison.layouts {
        for point in &layout.trace {
            let TracePoint { phase, iteration, evaluations, energy, crossings } = point;
            let (method, targets) = (&layout.row.method, layout.row.targets.name());
            table.row(&[
                method,
                &targets,
                &phase.name(),
                iteration,
                evaluations,
                &fixed(*energy, 9),
                crossings,
            ]);
        }
    }
    table.into_string()
}
