import { defineConfig } from 'vite';

// The daemon serves index.html at / and everything else below /viewer/. `npm run dev` asks a running daemon for data:
// MAPKEEP_HTTP=http://127.0.0.1:8080 npm run dev.
export default defineConfig({
  base: '/viewer/',
  cacheDir: process.env.VITE_CACHE ?? 'node_modules/.vite',
  esbuild: { jsx: 'automatic', jsxImportSource: 'preact' },
  build: {
    target: 'es2022',
    chunkSizeWarningLimit: 1200,
    modulePreload: { polyfill: false },
    reportCompressedSize: false,
    rollupOptions: {
      output: { manualChunks: { three: ['three'] } },
    },
  },
  server: { proxy: { '/v1': process.env.MAPKEEP_HTTP ?? 'http://127.0.0.1:8080' } },
});
