//! The files of a folder, parted into series, and the one that is meant.
//!
//! **Input** a folder, or one file of it. **Output** [`Chosen`]: the slices of one series, in no order yet.
//! **Steps** 1. every file of the folder and of those in it, in the order of their names; 2. what each is, by its
//! content; 3. images with one series identifier, kind of scanner, size, spacing and orientation belong together;
//! where several lie at one place, they are told apart by time, acquisition or echo; 4. the one series that can be a
//! volume, or the one asked for.
//! **Guarantees** the result does not depend on the order in which the system lists files; links to folders are not
//! followed; nothing of the patient is shown.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use espalier_model::Report;
use rayon::prelude::*;

use super::error::{DicomError, Listed, Obstacle};
use super::header::{Found, Object, Slice, inspect};
use super::stack;
use crate::{ReadError, ReadOptions};

/// A study has some thousand files; a folder of more is not what was meant.
const MAX_FILES: usize = 100_000;
/// Directions of one series may differ by rounding.
const MAX_AXIS_DIFFERENCE: f64 = 1e-3;
/// Pixel spacings likewise, by this share.
const MAX_SPACING_DIFFERENCE: f64 = 1e-4;
/// What the entries of [`Slice::phases`] are called.
const PHASES: [&str; 3] = ["time", "acquisition", "echo"];

/// A slice and its file.
#[derive(Clone, Debug)]
pub(super) struct Image {
    pub(super) path: PathBuf,
    pub(super) slice: Slice,
}

/// The slices of one series.
pub(super) struct Chosen {
    pub(super) images: Vec<Image>,
    pub(super) modality: String,
}

/// Images that belong together.
struct Group {
    objects: Vec<Object>,
    /// By what it was told apart from others of the same series.
    phase: String,
}

/// What lies in a folder.
#[derive(Default)]
struct Contents {
    groups: Vec<Group>,
    damaged: Vec<Object>,
    n_files: usize,
    n_other: usize,
    n_without_pixels: usize,
}

/// Finds the slices of the series that `path` means.
pub(super) fn choose(path: &Path, options: &ReadOptions, report: &mut Report) -> Result<Chosen, ReadError> {
    let is_file = fs::metadata(path)?.is_file();
    let folder = if is_file { path.parent().unwrap_or(Path::new("")) } else { path };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let mut files = list_files(folder, !is_file)?;
    if is_file {
        // The file itself is compared by its name within the folder.
        files
            .iter_mut()
            .filter(|file| file.file_name() == path.file_name())
            .for_each(|file| path.clone_into(file));
    }
    let mut contents = inspect_all(&files, options)?;
    contents.part_by_phase();
    contents.groups.sort_by_key(|group| {
        let first = &group.objects[0];
        (first.series_number.is_none(), first.series_number, first.path.clone())
    });

    let index = if is_file { contents.group_of(path)? } else { contents.meant(options)? };
    let n_groups = contents.groups.len();
    let Group { objects, .. } = contents.groups.swap_remove(index);
    let modality = objects[0].modality.clone();
    contents.check_damage(&objects[0].series_uid)?;
    report.count_usize("dicom_files", contents.n_files - contents.n_other);
    report.count_usize("dicom_images_of_the_series", objects.len());
    report.count_usize("dicom_other_series", n_groups - 1);
    report.count_usize("dicom_without_pixels", contents.n_without_pixels);
    report.count_usize("files_not_dicom", contents.n_other);
    let mut images = Vec::new();
    for object in objects {
        let slice = object.slice.map_err(|obstacle| {
            let file = (!is_file).then(|| own_name(&object.path));
            ReadError::from(DicomError::Unfit { obstacle, file })
        })?;
        images.push(Image { path: object.path, slice });
    }
    Ok(Chosen { images, modality })
}

pub(super) fn own_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// The files of a folder, and of the folders in it if `is_deep`, by name.
pub(super) fn list_files(folder: &Path, is_deep: bool) -> Result<Vec<PathBuf>, ReadError> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder)? {
            let entry = entry?;
            let kind = entry.file_type()?;
            if kind.is_dir() && is_deep {
                folders.push(entry.path());
            } else if kind.is_file() || (kind.is_symlink() && entry.path().is_file()) {
                files.push(entry.path());
            }
            if files.len() + folders.len() > MAX_FILES {
                return Err(DicomError::TooManyFiles { limit: MAX_FILES }.into());
            }
        }
    }
    files.sort();
    Ok(files)
}

fn inspect_all(files: &[PathBuf], options: &ReadOptions) -> Result<Contents, ReadError> {
    let gate = Mutex::new(());
    let found: Vec<std::io::Result<Found>> =
        files.par_iter().map(|file| inspect(file, options.max_bytes, &gate)).collect();
    let mut contents = Contents { n_files: files.len(), ..Contents::default() };
    let mut of_series: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for found in found {
        let object = match found? {
            Found::Other => {
                contents.n_other += 1;
                continue;
            }
            Found::NoImage => {
                contents.n_without_pixels += 1;
                continue;
            }
            Found::Image(object) => *object,
        };
        if let Err(Obstacle::Damaged { .. } | Obstacle::Truncated { .. }) = object.slice {
            contents.damaged.push(object);
            continue;
        }
        let known = of_series.entry(object.series_uid.clone()).or_default();
        let place = known.iter().find(|&&group| belong_together(&contents.groups[group].objects[0], &object));
        match place {
            Some(&group) => contents.groups[group].objects.push(object),
            None => {
                known.push(contents.groups.len());
                contents.groups.push(Group { objects: vec![object], phase: String::new() });
            }
        }
    }
    Ok(contents)
}

/// Whether two images with one series identifier are of one stack.
fn belong_together(a: &Object, b: &Object) -> bool {
    let slices_match = match (&a.slice, &b.slice) {
        (Ok(a), Ok(b)) => {
            let is_near = |i: usize| a.axes[i].abs_diff_eq(b.axes[i], MAX_AXIS_DIFFERENCE);
            let is_alike =
                |i: usize| (a.spacing[i] - b.spacing[i]).abs() <= MAX_SPACING_DIFFERENCE * a.spacing[i];
            is_near(0) && is_near(1) && is_alike(0) && is_alike(1) && a.is_localizer == b.is_localizer
        }
        (Err(a), Err(b)) => std::mem::discriminant(a) == std::mem::discriminant(b),
        _ => false,
    };
    slices_match && a.size == b.size && a.modality == b.modality
}

impl Group {
    fn slices(&self) -> Option<Vec<&Slice>> {
        self.objects.iter().map(|object| object.slice.as_ref().ok()).collect()
    }

    /// Whether it can be a volume.
    fn is_candidate(&self) -> bool {
        self.objects.len() > 1 && self.slices().is_some_and(|slices| !slices[0].is_localizer)
    }

    /// The group as it is, or one for each time, acquisition or echo, if that is what tells images of one place apart.
    fn parted(self) -> Vec<Self> {
        let Some(slices) = self.slices().filter(|slices| stack::has_shared_places(slices)) else {
            return vec![self];
        };
        for (phase, name) in PHASES.iter().enumerate() {
            let mut parts: BTreeMap<Option<&str>, Vec<&Slice>> = BTreeMap::new();
            for slice in &slices {
                parts.entry(slice.phases[phase].as_deref()).or_default().push(slice);
            }
            if parts.len() > 1 && !parts.values().any(|part| stack::has_shared_places(part)) {
                return self.part_by(phase, name);
            }
        }
        vec![self]
    }

    fn part_by(self, phase: usize, name: &str) -> Vec<Self> {
        let mut parts: BTreeMap<Option<String>, Vec<Object>> = BTreeMap::new();
        for object in self.objects {
            let value = object.slice.as_ref().ok().and_then(|slice| slice.phases[phase].clone());
            parts.entry(value).or_default().push(object);
        }
        let number = |value: Option<String>| value.and_then(|value| value.parse::<i64>().ok());
        let label = |value| number(value).map_or(name.to_owned(), |number| format!("{name} {number}"));
        parts.into_iter().map(|(value, objects)| Self { objects, phase: label(value) }).collect()
    }

    fn listed(&self, index: usize) -> Listed {
        let first = &self.objects[0];
        let mut remarks = Vec::new();
        if let Err(obstacle) = &first.slice {
            remarks.push(obstacle.to_string());
        } else if self.slices().is_some_and(|slices| slices[0].is_localizer) {
            remarks.push("a localizer".to_owned());
        }
        if !self.phase.is_empty() {
            remarks.push(self.phase.clone());
        }
        let step = self.slices().map_or(f64::NAN, |slices| stack::usual_distance(&slices));
        let [x, y] = first.slice.as_ref().map_or([f64::NAN; 2], |slice| slice.spacing);
        Listed {
            index: index + 1,
            number: first.series_number,
            modality: first.modality.clone(),
            n_images: self.objects.len(),
            size: first.size,
            spacing_mm: [x, y, step],
            remark: remarks.join(", "),
        }
    }
}

impl Contents {
    fn part_by_phase(&mut self) {
        self.groups = std::mem::take(&mut self.groups).into_iter().flat_map(Group::parted).collect();
    }

    fn listed(&self) -> Vec<Listed> {
        self.groups.iter().enumerate().map(|(index, group)| group.listed(index)).collect()
    }

    /// The group of a file.
    fn group_of(&self, path: &Path) -> Result<usize, DicomError> {
        if let Some(object) = self.damaged.iter().find(|object| object.path == path) {
            return Err(unfit(object, None));
        }
        let holds = |group: &Group| group.objects.iter().any(|object| object.path == path);
        self.groups.iter().position(holds).ok_or(DicomError::NoImage)
    }

    /// The group asked for, or the only one that can be a volume.
    fn meant(&self, options: &ReadOptions) -> Result<usize, DicomError> {
        if let Some(index) = options.series {
            let is_there = (1..=self.groups.len()).contains(&index);
            return if is_there {
                Ok(index - 1)
            } else {
                Err(DicomError::NoSuchSeries { index, series: self.listed() })
            };
        }
        let candidates: Vec<usize> =
            (0..self.groups.len()).filter(|&i| self.groups[i].is_candidate()).collect();
        match (candidates.as_slice(), self.groups.as_slice()) {
            (&[only], _) => Ok(only),
            ([], [_]) => Ok(0),
            ([], []) => Err(self.nothing()),
            ([], groups) => {
                // Where all of them fail alike, that is the reason.
                let code = |group: &Group| group.objects[0].slice.as_ref().err().map(std::mem::discriminant);
                let first = code(&groups[0]);
                if first.is_some() && groups.iter().all(|group| code(group) == first) {
                    Ok(0)
                } else {
                    Err(DicomError::Ambiguous { series: self.listed() })
                }
            }
            _ => Err(DicomError::Ambiguous { series: self.listed() }),
        }
    }

    fn nothing(&self) -> DicomError {
        let none = DicomError::NoImages { n_files: self.n_files, n_objects: self.n_without_pixels };
        self.damaged.first().map_or(none, |object| unfit(object, Some(own_name(&object.path))))
    }

    /// A damaged file that is of the series, or may be, must not be left out in silence.
    fn check_damage(&self, series_uid: &str) -> Result<(), DicomError> {
        let may_belong = |object: &&Object| object.series_uid.is_empty() || object.series_uid == series_uid;
        let damaged = self.damaged.iter().find(may_belong);
        damaged.map_or(Ok(()), |object| Err(unfit(object, Some(own_name(&object.path)))))
    }
}

fn unfit(object: &Object, file: Option<String>) -> DicomError {
    let obstacle = object.slice.clone().err().unwrap_or(Obstacle::Damaged { what: "it cannot be read" });
    DicomError::Unfit { obstacle, file }
}
