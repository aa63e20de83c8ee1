//! Single warm ICP stages, with the associations and metrics of the presets and the other
//! libraries.
//!
//! Run `cargo bench -p hicp-benches --bench stage`.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use hicp_benches::{OBJECTS, case, stages};
use hybrid_icp::core::Problem;
use hybrid_icp::icp::{Session, Workspace};
use hybrid_icp::raster::Rasterizer;

fn stage(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("stage");
    for object in OBJECTS {
        let case = case(object);
        let problem = Problem::new(&case.scene.model, &case.scene.observation);
        for (name, mut stage) in stages::all() {
            let mut workspace = Workspace::new(Rasterizer::default());
            group.bench_function(BenchmarkId::new(name, case.name), |bencher| {
                bencher.iter(|| {
                    stage.run(
                        &problem,
                        &case.init,
                        &mut Session::new(&mut workspace, &mut ()),
                    )
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, stage);
criterion_main!(benches);
