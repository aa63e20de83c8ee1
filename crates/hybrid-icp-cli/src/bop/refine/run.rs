//! Runs a refinement of a result file.

use std::collections::BTreeSet;
use std::time::Instant;

use anyhow::bail;
use hicp_bop::{DatasetRefiner, FrameResult, FrameRows, Scenes, frames_of};
use hicp_io::RowLog;
use hicp_io::bop::ResultRow;
use hybrid_icp::Preset;
use rayon::prelude::*;

use super::job::RefineJob;
use super::summary::{Distrust, mean_seconds, report_faults, summary};
use super::{journal, rows_file, settings, warnings};
use crate::bop::models;
use crate::interrupt;
use crate::outputs::journal_of;
use crate::terminal::{counted, progress_bar, say_beside, warn};

impl RefineJob<'_> {
    /// Refines the rows, writes the output and reports what happened.
    ///
    /// Returns the mean seconds per pose that reached the pipeline, `None` without any.
    pub(crate) fn run(&self, mut rows: Vec<ResultRow>) -> anyhow::Result<Option<f64>> {
        let dataset = self.dataset.open()?;
        let frames = frames_of(&rows);
        let pool = self.threads.pool(frames.len())?;
        let start = Instant::now();
        let folder = self.models.open(&dataset)?;
        // Read the settings first: if a file changes later, `--resume` must detect the change.
        let settings = settings::of(self, &rows, &folder);
        let objects: BTreeSet<u32> = rows.iter().map(|row| row.obj_id).collect();
        let models = pool.install(|| models::read_from(&folder, &objects));
        pool.install(|| models::warn_of(&models, folder.dir(), folder.info_path()));
        let preset: Result<Preset, _> = self.pipeline.name.parse();
        let has_color = self.dataset.has_color();
        // Without color images, `color` runs only if `--pipeline` names it.
        let compares = match preset {
            Ok(Preset::Color) => true,
            Ok(_) => self.estimates() && has_color,
            Err(_) => has_color,
        };
        let uncolored = models::color_faults(&self.models, &models, &folder, compares);
        uncolored.iter().for_each(warn);
        let shared = DatasetRefiner {
            models,
            scenes: Scenes::new(
                &dataset,
                &self.dataset.split,
                pool.current_num_threads() + 1,
            ),
            masks: self.masks.clone(),
        };
        let (journal, mut results) = match journal_of(self.output) {
            Some(path) => {
                let (journal, results) = journal::open(&path, &settings, self.resume, &frames)?;
                (Some(journal), results)
            }
            None => (None, vec![None; frames.len()]),
        };
        let resumed = results.iter().flatten().count();
        let journal_ref = journal.as_ref();
        let ran = pool.install(|| self.work(&shared, journal_ref, &rows, &frames, &mut results));
        if interrupt::asked() && ran.is_err() && journal.is_some() {
            bail!(
                "interrupted: {} of {} frames are done; continue with {}",
                results.iter().flatten().count(),
                frames.len(),
                self.resumed_by
            );
        }
        ran?;
        let results: Vec<FrameResult> = results.into_iter().flatten().collect();
        for result in &results {
            result.enter(&mut rows, self.rescore, self.timed);
        }
        let count = results.iter().filter(|result| result.uncolored).count();
        if count > 0 && compares {
            let of = counted(results.len(), "frame");
            warn(format_args!(
                "without an image in rgb/, the rows of {count} of {of} are refined by depth alone"
            ));
        }
        let poses = (!self.estimates()).then_some("that --results is in mm");
        let images = warnings::about_images(&results, &rows, poses);
        // The output may replace the input. Write it last, so that a run that fails before can be
        // continued.
        if let Some(path) = self.rows {
            rows_file::write(path, &rows, &results, self.estimates())?;
        }
        let others = results
            .iter()
            .flat_map(|result| result.alternatives(&rows, self.hypotheses - 1));
        let others: Vec<ResultRow> = others.collect();
        if self.estimates() {
            let found = results.iter().flat_map(|result| &result.rows);
            let found = found.filter(|row| row.pose.is_some());
            let found: BTreeSet<usize> = found.map(|row| row.index).collect();
            let mut index = 0..;
            rows.retain(|_| index.next().is_some_and(|index| found.contains(&index)));
        }
        // The other poses come last, so that the numbers of the rows do not change.
        let n_rows = rows.len();
        rows.extend(others);
        hicp_io::bop::write_results(self.output, &rows)?;
        // Somebody may repair what is damaged.
        let damaged = |result: &FrameResult| !result.faults.is_empty();
        let damaged = results.iter().any(damaged) || !shared.models.broken.is_empty();
        if let Some(journal) = journal.filter(|_| damaged || !self.keeps_journal) {
            journal.remove()?;
        }

        let distrust = Distrust::of(&results);
        let mut text = format!(
            "{}: {} of {} by {} in {:.1} s on {}",
            self.output.display(),
            counted(n_rows, "row"),
            counted(results.len(), "frame"),
            self.pipeline.name,
            start.elapsed().as_secs_f64(),
            counted(pool.current_num_threads(), "thread"),
        );
        if resumed > 0 {
            text.push_str(&format!(", {resumed} frames from the journal"));
        }
        text.push_str(&summary(self, &results, &shared.models, &distrust));
        // Warnings go to standard error even if standard output fails.
        let said = say_beside(&[Some(self.output), self.rows], text);
        images.iter().for_each(warn);
        if self.distrusts {
            distrust.warn(self);
        }
        report_faults(self, (&shared.models, folder.dir()), &results)?;
        said?;
        Ok(mean_seconds(&results))
    }

    /// Refines the images that have no result yet.
    ///
    /// Threads process images in order, so they need only a few scenes at a time. The memory use is
    /// one image per thread.
    fn work(
        &self,
        shared: &DatasetRefiner,
        journal: Option<&RowLog>,
        rows: &[ResultRow],
        frames: &[FrameRows],
        results: &mut [Option<FrameResult>],
    ) -> anyhow::Result<()> {
        let progress = progress_bar(rows.len(), "rows");
        if journal.is_some() {
            interrupt::can_resume(self.resumed_by);
        }
        let places = results.iter_mut().zip(frames).enumerate();
        let ran = places.par_bridge().try_for_each_init(
            || self.pipeline.refiner(),
            |refiner, (place, (result, (frame, indices)))| {
                if interrupt::asked() {
                    bail!("interrupted");
                }
                if result.is_none() {
                    let done = shared.frame(refiner, *frame, rows, indices);
                    if let Some(journal) = journal {
                        journal.append(&serde_json::to_string(&(place, &done))?)?;
                        journal.sync()?;
                    }
                    *result = Some(done);
                }
                progress.inc(indices.len() as u64);
                Ok::<(), anyhow::Error>(())
            },
        );
        progress.finish_and_clear();
        ran
    }
}
