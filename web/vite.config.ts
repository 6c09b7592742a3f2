import { defineConfig } from "vite";

// Two outputs: the live page in view/, and report.js with report.css, which a report holds inside itself.
export default defineConfig(({ mode }) =>
  mode === "report"
    ? {
        build: {
          outDir: "../src/plumbob/web",
          emptyOutDir: false,
          copyPublicDir: false,
          lib: { entry: "src/report/main.ts", formats: ["iife"], name: "plumbobReport", fileName: () => "report.js", cssFileName: "report" },
        },
      }
    : {
        base: "./",
        // Tests compare tables with the library that they are of.
        server: { fs: { allow: [".."] } },
        build: { outDir: "../src/plumbob/web/view", emptyOutDir: true, assetsInlineLimit: 0, chunkSizeWarningLimit: 900 },
      },
);
