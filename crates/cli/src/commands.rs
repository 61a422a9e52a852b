//! What each command does.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::CommandFactory;
use espalier_model::Diagnose;
use espalier_pipeline::{
    Align, Artifact, Cache, ChangeOf, CompareRequest, Config, DoctorRequest, Error, GroupRequest,
    JuxtaposeParams, JuxtaposeRequest, Loaded, Override, Plan, PlotRequest, Plotted, Reason, Request,
    SideFile, Space, Stage, Subject, Summary, SweepRequest, WayTo,
};

use crate::args::{
    Arguments, Command, CompareArguments, DoctorArguments, GroupArguments, JuxtaposeArguments,
    LocateArguments, PhantomArguments, PlaceArguments, ProfileArguments, Rerun, RunArguments, StageArguments,
    SweepArguments, VerifyArguments,
};
use crate::progress::{self, Progress};
use crate::{checks, cohort, config, explain, failure, info, summary};

/// Memory assumed where the machine does not tell its own.
const FALLBACK_MEMORY_BYTES: u64 = 4 << 30;

/// Does what the arguments say.
pub(crate) fn execute(arguments: &Arguments) -> anyhow::Result<()> {
    let summary = match &arguments.command {
        Command::Run(run) if run.dry_run => return print_plan(arguments, run),
        Command::Run(run) => run_pipeline(arguments, run)?,
        Command::Compare(compare) => run_compare(arguments, compare)?,
        Command::Juxtapose(juxtapose) => run_juxtapose(arguments, juxtapose)?,
        Command::Sweep(sweep) => run_sweep(arguments, sweep)?,
        Command::Group(group) => run_group(arguments, group)?,
        Command::Cohort(cohort) => return cohort::execute(arguments, cohort),
        Command::Bids(bids) => return cohort::execute_bids(arguments, bids),
        Command::Phantom(phantom) => make_phantom(arguments, phantom)?,
        Command::Volume(stage) => run_stage(arguments, stage, Stage::Volume)?,
        Command::Skeleton(stage) => run_stage(arguments, stage, Stage::Skeleton)?,
        Command::Radius(stage) => run_stage(arguments, stage, Stage::Radius)?,
        Command::Tree(stage) => run_stage(arguments, stage, Stage::Tree)?,
        Command::Views(stage) => run_stage(arguments, stage, Stage::Views)?,
        Command::Embed(stage) => run_stage(arguments, stage, Stage::Embed)?,
        Command::Render(stage) => run_stage(arguments, stage, Stage::Render)?,
        Command::Report(stage) => run_stage(arguments, stage, Stage::Report)?,
        Command::Verify(verify) => return verify_folder(arguments, verify),
        Command::Profile(profile) => return print_profile(arguments, profile),
        Command::Doctor(doctor) => return examine(arguments, doctor),
        Command::Locate(locate) => return print_located(arguments, locate),
        Command::Info(arguments_of_info) => return info::print(arguments, arguments_of_info),
        Command::Config(command) => return config::execute(command, arguments.common.json),
        Command::Explain(explain) => return explain::print(explain, arguments.common.json),
        Command::Completions { shell } => {
            progress::result(completions(*shell).trim_end());
            return Ok(());
        }
    };
    summary::print(&summary, arguments.common.json);
    Ok(())
}

/// The script that completes commands and options.
fn completions(shell: clap_complete::Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "espalier", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

/// Checks a run folder and prints what came of each claim.
fn verify_folder(arguments: &Arguments, verify: &VerifyArguments) -> anyhow::Result<()> {
    let threads = arguments.common.threads.map(usize::from);
    let verification = espalier_pipeline::verify(&verify.folder, threads)?;
    if arguments.common.json {
        progress::result(verification.to_json().trim_end());
    } else {
        let is_shown = |fails: bool| fails || !arguments.common.quiet;
        checks::table(&verification, is_shown).iter().for_each(|line| progress::result(line));
        progress::result(&format!("digest {}", verification.digest));
    }
    Ok(verification.verdict()?)
}

/// Prints the calibre on the way to a place, or draws it.
fn print_profile(arguments: &Arguments, profile: &ProfileArguments) -> anyhow::Result<()> {
    let PlaceArguments { node, branch, to } = profile.place;
    let to_point = to.map(|point| WayTo::Point(point.into()));
    let way_to = node.map(WayTo::Node).or(branch.map(WayTo::Branch)).or(to_point);
    let way_to = way_to.ok_or_else(|| anyhow!("say where to: --node, --branch or --to"))?;
    if let Some(plot) = &profile.plot {
        let request = PlotRequest {
            folder: profile.folder.clone(),
            way_to,
            plot: plot.clone(),
            overrides: arguments.common.overrides.clone(),
        };
        let plotted = espalier_pipeline::plot_profile(&request)?;
        if arguments.common.json {
            progress::result(&narrowest_json(plot, &plotted).to_string());
        } else {
            progress::result(&narrowest_line(&plotted));
            progress::result(&plot.display().to_string());
        }
        return Ok(());
    }
    let table = espalier_pipeline::profile(&profile.folder, way_to)?;
    progress::result(&if arguments.common.json {
        summary::rows(&table)
    } else {
        table.trim_end().to_owned()
    });
    Ok(())
}

fn narrowest_json(plot: &Path, plotted: &Plotted) -> serde_json::Value {
    let place = plotted.narrowest.as_ref().map(|place| {
        serde_json::json!({
            "narrowing_percent": place.narrowing_percent,
            "from_root_mm": place.from_root_mm,
            "branch": place.branch,
            "node": place.node,
            "radius_mm": place.radius_mm,
            "reference_radius_mm": place.reference_radius_mm,
            "is_listed": plotted.is_listed,
        })
    });
    serde_json::json!({ "file": plot.display().to_string(), "narrowest": place })
}

fn narrowest_line(plotted: &Plotted) -> String {
    let Some(place) = &plotted.narrowest else { return "nowhere narrower than its reference".to_owned() };
    format!(
        "narrowest {:.1} % at {:.4} mm from the root, branch {}, node {}: radius {:.4} mm of {:.4}{}",
        place.narrowing_percent,
        place.from_root_mm,
        place.branch,
        place.node,
        place.radius_mm,
        place.reference_radius_mm,
        if plotted.is_listed { "" } else { " (not listed in stenoses.tsv)" }
    )
}

/// Prints where points lie on both sides.
fn print_located(arguments: &Arguments, locate: &LocateArguments) -> anyhow::Result<()> {
    let in_patient = match (locate.lps, locate.voxel) {
        (true, _) => Space::Lps,
        (_, true) => Space::Voxel,
        _ => Space::Ras,
    };
    let spaces = [in_patient, if locate.pixel { Space::Pixel } else { Space::Plane }];
    let point = |text: &String| {
        espalier_pipeline::read_point(text, spaces).map_err(|cause| Error::Point { source_name: None, cause })
    };
    let mut points = locate.points.iter().map(point).collect::<Result<Vec<_>, _>>()?;
    if let Some(path) = &locate.from {
        let (source_name, table) = read_table(path)?;
        let more = espalier_pipeline::read_points(&table, spaces);
        points.extend(more.map_err(|cause| Error::Point { source_name: Some(source_name), cause })?);
    }
    let max_memory = arguments.common.max_memory.unwrap_or_else(half_of_memory);
    let located = espalier_pipeline::locate(&locate.folder, &points, max_memory)?;
    let text = match (arguments.common.json, points.len()) {
        (true, _) => located.to_json(),
        (false, 1) => located.to_text(),
        _ => located.to_tsv(),
    };
    progress::result(text.trim_end());
    Ok(())
}

/// The largest table of points that is read.
const MAX_TABLE_BYTES: u64 = 64 << 20;

/// A table and its name, from a file or from standard input.
fn read_table(path: &Path) -> Result<(String, String), Error> {
    let (name, read): (&Path, Box<dyn Read>) = if path == Path::new("-") {
        (Path::new("standard input"), Box::new(std::io::stdin()))
    } else {
        let open = File::open(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
        (path, Box::new(open))
    };
    let mut text = String::new();
    let n_read = read.take(MAX_TABLE_BYTES + 1).read_to_string(&mut text);
    let needed = n_read.map_err(|source| Error::Read { path: name.to_owned(), source })? as u64;
    if needed > MAX_TABLE_BYTES {
        return Err(Error::TooLarge { path: name.to_owned(), needed, limit: MAX_TABLE_BYTES });
    }
    Ok((name.display().to_string(), text))
}

fn run_pipeline(arguments: &Arguments, run: &RunArguments) -> anyhow::Result<Summary> {
    perform(arguments, &pipeline_request(arguments, run)?)
}

fn pipeline_request(arguments: &Arguments, run: &RunArguments) -> anyhow::Result<Request> {
    let loaded = load(&run.config_or_input, &arguments.common.overrides)?;
    let out = run.out.clone().unwrap_or_else(|| espalier_pipeline::run::default_folder(&loaded.config));
    let Rerun { force, wait } = run.rerun;
    Ok(Request { from: run.from, to: run.to, force, wait, ..request(arguments, loaded, out) })
}

/// Prints which stages a run would do, and why.
fn print_plan(arguments: &Arguments, run: &RunArguments) -> anyhow::Result<()> {
    let plans = espalier_pipeline::plan(&pipeline_request(arguments, run)?)?;
    if arguments.common.json {
        progress::result(&summary::plan(&plans));
        return Ok(());
    }
    let costs: Vec<_> = plans.iter().filter_map(|plan| Some((plan.stage, plan.cost?))).collect();
    for Plan { stage, reason, is_shared, .. } in plans {
        let text = match reason {
            None => "kept".to_owned(),
            Some(reason @ Reason::After { .. }) => format!("to do if that changes: {reason}"),
            Some(reason) if is_shared => format!("to copy from the cache: {reason}"),
            Some(reason) => format!("to do: {reason}"),
        };
        progress::result(&format!("{stage:<9} {text}"));
    }
    if !costs.is_empty() {
        progress::result("");
        progress::result(espalier_pipeline::costs_table(&costs).trim_end());
    }
    Ok(())
}

/// Prints what inputs are. One that cannot be read does not keep the others from being looked at.
fn examine(arguments: &Arguments, doctor: &DoctorArguments) -> anyhow::Result<()> {
    let (mut first_error, mut entries) = (None, Vec::new());
    let threads = arguments.common.threads.map_or_else(cores, usize::from);
    for input in &doctor.inputs {
        let request = DoctorRequest {
            config_or_input: input.clone(),
            overrides: arguments.common.overrides.clone(),
            threads: arguments.common.threads.map(usize::from),
            max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
            data_dir: data_dir(),
        };
        let name = input.display().to_string();
        match espalier_pipeline::doctor(&request) {
            Ok(examined) if arguments.common.json => {
                entries.push(serde_json::json!({ "input": name, "found": examined.to_json(threads) }));
            }
            Ok(examined) => progress::result(examined.to_text(threads).trim_end()),
            Err(error) => {
                let (code, message, hint) = (error.code(), error.to_string(), error.hint());
                let told = serde_json::json!({ "code": code, "message": message, "hint": hint });
                entries.push(serde_json::json!({ "input": name, "error": told }));
                // The last word on the first one is that of every command.
                let error = anyhow::Error::from(error);
                if first_error.is_some() && !arguments.common.json {
                    failure::last_word(&error);
                }
                first_error.get_or_insert(error);
            }
        }
    }
    if arguments.common.json {
        let whole = serde_json::json!({ "format": "espalier-doctor", "version": 1, "inputs": entries });
        progress::result(&serde_json::to_string_pretty(&whole).unwrap_or_default());
    }
    first_error.map_or(Ok(()), Err)
}

/// How many threads a run has if nobody says.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn run_compare(arguments: &Arguments, compare: &CompareArguments) -> anyhow::Result<Summary> {
    let overrides = &arguments.common.overrides;
    let subjects = compare.subjects.iter().map(|path| subject(path, overrides));
    let request = CompareRequest {
        subjects: subjects.collect::<anyhow::Result<_>>()?,
        out: compare.out.clone(),
        overrides: overrides.clone(),
        threads: arguments.common.threads.map(usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
        data_dir: data_dir(),
        cache: cache(arguments),
    };
    let progress = Progress::new(&arguments.common);
    let compared = espalier_pipeline::compare(&request, &|event| progress.show(event))?;
    summary::table(&compared.table, arguments.common.json);
    Ok(compared.summary)
}

/// A run folder, or an input or config to be run.
fn subject(path: &Path, overrides: &[Override]) -> anyhow::Result<Subject> {
    // A folder that is no run but has DICOM slices in it is an input.
    let is_input = !is_run(path) && espalier_pipeline::is_dicom_folder(path);
    if path.is_dir() && !is_input {
        return Ok(Subject::Run(path.to_owned()));
    }
    load(path, overrides).map(|loaded| Subject::Config(Box::new(loaded)))
}

fn run_juxtapose(arguments: &Arguments, juxtapose: &JuxtaposeArguments) -> anyhow::Result<Summary> {
    let overrides = &arguments.common.overrides;
    let align = Align::ALL.into_iter().find(|align| align.name() == juxtapose.align).unwrap_or_default();
    let request = JuxtaposeRequest {
        subjects: [subject(&juxtapose.baseline, overrides)?, subject(&juxtapose.followup, overrides)?],
        out: juxtapose.out.clone(),
        overrides: overrides.clone(),
        params: JuxtaposeParams { align, ..JuxtaposeParams::default() },
        change: if juxtapose.change == "length" { ChangeOf::Length } else { ChangeOf::Radius },
        threads: arguments.common.threads.map(usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
        data_dir: data_dir(),
        cache: cache(arguments),
    };
    let progress = Progress::new(&arguments.common);
    let compared = espalier_pipeline::juxtapose(&request, &|event| progress.show(event))?;
    summary::table(&compared.table, arguments.common.json);
    Ok(compared.summary)
}

fn run_sweep(arguments: &Arguments, sweep: &SweepArguments) -> anyhow::Result<Summary> {
    let request = SweepRequest {
        config_or_input: sweep.config_or_input.clone(),
        overrides: arguments.common.overrides.clone(),
        axes: sweep.axes.clone(),
        out: sweep.out.clone(),
        threads: arguments.common.threads.map(usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
        data_dir: data_dir(),
        cache: cache(arguments),
    };
    let progress = Progress::new(&arguments.common);
    let swept = espalier_pipeline::sweep(&request, &|event| progress.show(event))?;
    summary::table(&swept.table, arguments.common.json);
    Ok(swept.summary)
}

fn run_group(arguments: &Arguments, group: &GroupArguments) -> anyhow::Result<Summary> {
    let request = GroupRequest {
        folders: group.folders.clone(),
        out: group.out.clone(),
        title: group.title.clone(),
        is_anonymous: group.anonymous,
        threads: arguments.common.threads.map(usize::from),
    };
    let grouped = espalier_pipeline::group(&request)?;
    grouped.notes.iter().for_each(|note| progress::line(&format!("note: {note}")));
    summary::table(&grouped.table, arguments.common.json);
    Ok(grouped.summary)
}

fn make_phantom(arguments: &Arguments, phantom: &PhantomArguments) -> anyhow::Result<Summary> {
    let mut overrides = vec![
        Override { key: "input.phantom".to_owned(), value: phantom.kind.clone() },
        Override { key: "seed".to_owned(), value: phantom.seed.to_string() },
    ];
    overrides.extend(arguments.common.overrides.iter().cloned());
    let text = "schema = 1\n[input]\nphantom = \"airway\"\n";
    let config = Config::parse(text, Path::new("command line"), &overrides).map_err(Error::from)?;
    let threads = arguments.common.threads.map(usize::from);
    Ok(espalier_pipeline::make_phantom(&config, &phantom.out, threads)?)
}

fn run_stage(arguments: &Arguments, stage: &StageArguments, which: Stage) -> anyhow::Result<Summary> {
    match stage.inputs.as_slice() {
        // A folder that is no run is one of DICOM slices.
        [folder] if folder.is_dir() && (which != Stage::Volume || is_run(folder)) => {
            run_stage_of_folder(arguments, stage, which, folder)
        }
        files => run_stage_on_files(arguments, stage, which, files),
    }
}

fn is_run(folder: &Path) -> bool {
    folder.join("provenance").is_dir()
}

/// A stage of a run folder, with the folder's own settings and files.
fn run_stage_of_folder(
    arguments: &Arguments,
    stage: &StageArguments,
    which: Stage,
    folder: &Path,
) -> anyhow::Result<Summary> {
    let own_config = folder.join("provenance/config.resolved.toml");
    let mut loaded = load(stage.config.as_ref().unwrap_or(&own_config), &arguments.common.overrides)?;
    if let (None, Some(_)) = (&stage.config, &loaded.config.input.path) {
        // The resolved config has only the name of the input; where it lies stands apart.
        loaded.config.input.path = espalier_pipeline::input_of_run(folder).or(loaded.config.input.path);
    }
    for side in SideFile::ALL {
        let (None, Some(path)) = (&stage.config, side.slot(&mut loaded.config)) else { continue };
        if path.is_empty() {
            continue;
        }
        // So has it of the files beside; a path given here and now starts from here.
        let is_set_now = arguments.common.overrides.iter().any(|set| set.key == side.key());
        let named = || Some(std::path::absolute(&*path).ok()?.to_string_lossy().into_owned());
        let known = if is_set_now { named() } else { espalier_pipeline::side_file_of_run(folder, side) };
        *path = known.unwrap_or_else(|| std::mem::take(path));
    }
    let out = stage.out.clone().unwrap_or_else(|| folder.to_owned());
    let Rerun { force, wait } = stage.rerun;
    let mut request =
        Request { from: Some(which), to: Some(which), force, wait, ..request(arguments, loaded, out) };
    if request.out != folder {
        let known = which.reads().iter().chain(&[Artifact::Traced, Artifact::Comparison]);
        let files = known.map(|artifact| (*artifact, folder.join(artifact.file())));
        request.files = files.filter(|(_, file)| file.exists()).collect();
        if request.files.contains_key(&Artifact::Mask) {
            request.files.remove(&Artifact::Traced);
        }
    }
    perform(arguments, &request)
}

fn run_stage_on_files(
    arguments: &Arguments,
    stage: &StageArguments,
    which: Stage,
    inputs: &[PathBuf],
) -> anyhow::Result<Summary> {
    let overrides = &arguments.common.overrides;
    let files = stage_files(which, inputs)?;
    let Rerun { force, wait } = stage.rerun;
    let out = stage.out.clone().ok_or_else(|| anyhow!("{which} on files needs -o DIR"))?;
    let mut loaded = match &stage.config {
        Some(config) => load(config, overrides)?,
        None => load_input(&inputs[0], overrides)?,
    };
    loaded.config.input.path = Some(std::path::absolute(&inputs[0])?.to_string_lossy().into_owned());
    loaded.config.input.phantom = None;
    perform(
        arguments,
        &Request {
            files,
            from: Some(which),
            to: Some(which),
            force,
            wait,
            ..request(arguments, loaded, out)
        },
    )
}

/// Which file is which artifact.
fn stage_files(stage: Stage, inputs: &[PathBuf]) -> anyhow::Result<BTreeMap<Artifact, PathBuf>> {
    let is_traced = stage == Stage::Tree && inputs.len() == 1;
    let wanted = if is_traced { &[Artifact::Traced] } else { stage.reads() };
    if wanted.len() != inputs.len() {
        let names: Vec<&str> = wanted.iter().map(|artifact| artifact.what()).collect();
        return Err(anyhow!(
            "{stage} takes {} files ({}), not {}",
            wanted.len(),
            names.join(", "),
            inputs.len()
        ));
    }
    Ok(wanted.iter().copied().zip(inputs.iter().cloned()).collect())
}

fn request(arguments: &Arguments, loaded: Loaded, out: PathBuf) -> Request {
    Request {
        loaded,
        out,
        from: None,
        to: None,
        files: BTreeMap::new(),
        force: false,
        wait: false,
        threads: arguments.common.threads.map(usize::from),
        max_memory_bytes: arguments.common.max_memory.unwrap_or_else(half_of_memory),
        data_dir: data_dir(),
        cache: cache(arguments),
    }
}

fn perform(arguments: &Arguments, request: &Request) -> anyhow::Result<Summary> {
    let progress = Progress::new(&arguments.common);
    Ok(espalier_pipeline::run(request, &|event| progress.show(event))?)
}

/// A config file, or an input with every setting at its default.
fn load(path: &Path, overrides: &[Override]) -> anyhow::Result<Loaded> {
    Ok(Loaded::read(path, overrides)?)
}

fn load_input(path: &Path, overrides: &[Override]) -> anyhow::Result<Loaded> {
    let config = Config::for_input(path, overrides).map_err(Error::from)?;
    Ok(Loaded { config, base_dir: PathBuf::new() })
}

#[allow(clippy::disallowed_methods, reason = "the command line is where the environment is read")]
pub(crate) fn data_dir() -> Option<PathBuf> {
    std::env::var_os("ESPALIER_DATA").map(PathBuf::from)
}

/// The store that runs share: none unless somebody has said where it lies.
#[allow(clippy::disallowed_methods, reason = "the command line is where the environment is read")]
pub(crate) fn cache(arguments: &Arguments) -> Option<Cache> {
    let named = arguments.common.cache.clone();
    let folder = named.or_else(|| std::env::var_os("ESPALIER_CACHE").map(PathBuf::from))?;
    let max_bytes = arguments.common.cache_size;
    (!folder.as_os_str().is_empty()).then_some(Cache { folder, max_bytes })
}

/// Half of the machine's memory.
pub(crate) fn half_of_memory() -> u64 {
    let total = || -> Option<u64> {
        let text = std::fs::read_to_string("/proc/meminfo").ok()?;
        let kilobytes = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
        kilobytes.split_whitespace().next()?.parse::<u64>().ok().map(|kb| kb * 1024)
    };
    total().map_or(FALLBACK_MEMORY_BYTES, |bytes| bytes / 2)
}
